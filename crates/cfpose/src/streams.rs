//! Named random streams: whoever draws random numbers has a stream of its own, so that drawing more in one place changes
//! nothing in another.

use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;

/// Return the random stream of a name under a seed.
///
/// ChaCha with 12 rounds; its 256-bit key is the seed in the first 8 bytes (little endian) and zeros, its stream number is the
/// 64-bit FNV-1a hash of the name. The same seed and name give the same numbers on every machine.
pub fn stream(seed: u64, name: &str) -> ChaCha12Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    let mut rng = ChaCha12Rng::from_seed(key);
    rng.set_stream(fnv1a(name.as_bytes()));
    rng
}

/// Hash bytes with 64-bit FNV-1a (Fowler, Noll, Vo).
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn a_stream_is_that_of_its_seed_and_name() {
        let draw = |seed, name| stream(seed, name).random::<f64>();
        assert_eq!(draw(1, "perturb"), draw(1, "perturb"));
        assert_ne!(draw(1, "perturb"), draw(1, "overlap"));
        assert_ne!(draw(1, "perturb"), draw(2, "perturb"));
    }
}
