//! Random streams: every trial has its own, and it depends on nothing but the trial.
//!
//! * The *key* of a trial is a 64-bit hash of scenario, parameters and repetition ([`trial_key`]).
//! * Its data come from ChaCha12 keyed by the experiment's seed, stream number = key ([`data_stream`]).
//! * A method's own randomness has a seed of its own ([`method_seed`]), so drawing more or less of it changes no data.
//!
//! So a grid that grows changes no old trial, every method sees the same data, and neither the order of trials nor the
//! number of threads or shards matters.

use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;

/// Hash bytes with 64-bit FNV-1a (Fowler, Noll, Vo): h = (h xor byte) * 0x100000001b3 from 0xcbf29ce484222325.
///
/// ```
/// // Published test vectors.
/// assert_eq!(cfpose_lab::seed::fnv1a(b""), 0xcbf2_9ce4_8422_2325);
/// assert_eq!(cfpose_lab::seed::fnv1a(b"a"), 0xaf63_dc4c_8601_ec8c);
/// assert_eq!(cfpose_lab::seed::fnv1a(b"foobar"), 0x8594_4171_f739_67e8);
/// ```
pub fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// Return the canonical text of a trial: what its key is the hash of.
///
/// Lines `cfpose.trial/1`, `scenario=NAME`, then `KEY=VALUE` for every parameter that differs from its default, sorted by
/// key, then `repetition=R` from 0; lines end with a newline. A parameter at its default is left out, so a scenario that
/// learns a new parameter keeps its old trials.
pub fn trial_text(scenario: &str, changed: &[(String, String)], repetition: usize) -> String {
    let mut sorted: Vec<&(String, String)> = changed.iter().collect();
    sorted.sort();
    let mut text = format!("cfpose.trial/1\nscenario={scenario}\n");
    for (key, value) in sorted {
        text.push_str(&format!("{key}={value}\n"));
    }
    text.push_str(&format!("repetition={repetition}\n"));
    text
}

/// Return the key of a trial: [`fnv1a`] of [`trial_text`].
///
/// ```
/// use cfpose_lab::seed::trial_key;
/// let changed = [("b_i".to_string(), "0.2".to_string())];
/// assert_eq!(trial_key("planar-curve", &changed, 0), 0x7d2d_e8d1_12db_0aa5);
/// assert_ne!(trial_key("planar-curve", &changed, 0), trial_key("planar-curve", &changed, 1));
/// ```
pub fn trial_key(scenario: &str, changed: &[(String, String)], repetition: usize) -> u64 {
    fnv1a(trial_text(scenario, changed, repetition).as_bytes())
}

/// Return the generator of a trial's data.
///
/// ChaCha with 12 rounds; its 256-bit key is the experiment's seed in the first 8 bytes (little endian) and zeros, its
/// stream number is the trial's key.
pub fn data_stream(seed: u64, key: u64) -> ChaCha12Rng {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let mut rng = ChaCha12Rng::from_seed(bytes);
    rng.set_stream(key);
    rng
}

/// Return the seed of a method's own randomness in a trial; the same for all methods.
pub fn method_seed(seed: u64, key: u64) -> u64 {
    fnv1a(format!("cfpose.method/1\nseed={seed}\ntrial={key:016x}\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    /// The values come from independent implementations of FNV-1a and ChaCha12. They are part of the contract: a change
    /// here would change every published figure.
    #[test]
    fn keys_and_streams_are_fixed_for_ever() {
        let changed = [("curve".to_string(), "fish".to_string()), ("b_i".to_string(), "0.2".to_string())];
        let text = trial_text("planar-curve", &changed, 7);
        assert_eq!(text, "cfpose.trial/1\nscenario=planar-curve\nb_i=0.2\ncurve=fish\nrepetition=7\n");
        let reversed = [changed[1].clone(), changed[0].clone()];
        assert_eq!(trial_key("planar-curve", &changed, 7), trial_key("planar-curve", &reversed, 7));
        let mut rng = data_stream(1, 42);
        assert_eq!([rng.next_u64(), rng.next_u64()], [1_233_778_620_155_662_350, 1_156_920_964_346_563_024]);
        assert_ne!(data_stream(1, 43).next_u64(), data_stream(1, 42).next_u64());
        assert_ne!(data_stream(2, 42).next_u64(), data_stream(1, 42).next_u64());
        assert_eq!(method_seed(1, 42), 0x0666_06e3_4957_4497);
    }
}
