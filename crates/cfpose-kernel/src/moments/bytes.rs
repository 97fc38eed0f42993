//! Gathered moments as bytes: one way to write each, so that equal sums are equal files.
//!
//! `CFPM1` and a line feed; dimension, degree (a byte each), length of the label (two bytes), label; centre (dim doubles); number of points
//! (8 bytes); sum w^2, then the sums by degree, then lexicographically by their exponents. A sum is a sign (0, 1), the first limb that is not
//! 0, how many follow, and these limbs of 32 bits: sum_i limb_i 2^(32 i - 1074). Last the SHA-256 of all before. Little-endian.

use sha2::{Digest, Sha256};

use super::exact::{Canonical, ExactSum, LIMBS};
use super::gathered::{GatheredMoments, MAX_DEGREE, num_moments};

const MAGIC: &[u8] = b"CFPM1\n";

/// Bytes of the digest.
const DIGEST: usize = 32;

/// Longest label.
const MOST_LABEL: usize = 1000;

/// Why bytes are no moments.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BytesError {
    /// They begin otherwise.
    #[error("this is no moment file; `cfpose moments FILE --features F -o OUT.cfm` writes one")]
    Foreign,
    /// Something is cut off, added or changed.
    #[error("the moment file is damaged ({what}); write it again")]
    Damaged {
        /// What shows it.
        what: &'static str,
    },
}

impl GatheredMoments {
    /// Write the sums; equal sums give equal bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([self.dim as u8, self.degree as u8]);
        // Longer labels are cut at a character: they are for people.
        let mut end = self.label.len().min(MOST_LABEL);
        while !self.label.is_char_boundary(end) {
            end -= 1;
        }
        bytes.extend((end as u16).to_le_bytes());
        bytes.extend(&self.label.as_bytes()[..end]);
        self.centre[..self.dim].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend(self.count.to_le_bytes());
        for sum in std::iter::once(&self.squares).chain(&self.sums) {
            let Canonical { negative, first, limbs } = sum.canonical();
            bytes.extend([u8::from(negative), first as u8, limbs.len() as u8]);
            limbs.iter().for_each(|limb| bytes.extend(limb.to_le_bytes()));
        }
        let digest = Sha256::digest(&bytes);
        bytes.extend(digest);
        bytes
    }

    /// Read what [`GatheredMoments::to_bytes`] wrote; memory is bounded by the format, whatever the bytes claim.
    ///
    /// # Errors
    /// [`BytesError`] for other bytes, and any that are missing, added or changed.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BytesError> {
        let damaged = |what| BytesError::Damaged { what };
        if !bytes.starts_with(MAGIC) {
            return Err(BytesError::Foreign);
        }
        let body = bytes.len().checked_sub(DIGEST).filter(|at| *at >= MAGIC.len()).ok_or(damaged("it is cut off"))?;
        let (body, digest) = bytes.split_at(body);
        if Sha256::digest(body).as_slice() != digest {
            return Err(damaged("its digest does not fit its content"));
        }
        let mut rest = Reader(&body[MAGIC.len()..]);
        let [dim, degree] = rest.take()?;
        let (dim, degree) = (usize::from(dim), usize::from(degree));
        if !(1..=3).contains(&dim) || degree > MAX_DEGREE {
            return Err(damaged("its dimension or degree does not exist"));
        }
        let length = usize::from(u16::from_le_bytes(rest.take()?));
        let label = rest.slice(length)?;
        let label = std::str::from_utf8(label).ok().filter(|label| label.len() <= MOST_LABEL);
        let label = label.ok_or(damaged("its label is no text"))?;
        let mut centre = [0.0; 3];
        for entry in &mut centre[..dim] {
            *entry = f64::from_le_bytes(rest.take()?);
        }
        if !centre.iter().all(|x| x.is_finite()) {
            return Err(damaged("its centre is not finite"));
        }
        let mut read = Self::new(dim, degree, centre, label);
        read.count = u64::from_le_bytes(rest.take()?);
        read.squares = rest.sum()?;
        for at in 0..num_moments(dim, degree) {
            read.sums[at] = rest.sum()?;
        }
        if !rest.0.is_empty() {
            return Err(damaged("something follows its last sum"));
        }
        let usable = |x: f64| x > 0.0 && x.is_finite();
        if read.count == 0 || read.count > i64::MAX as u64 || !usable(read.weight()) || !usable(read.squares.value()) {
            return Err(damaged("it holds no point with a weight"));
        }
        Ok(read)
    }
}

/// What is left of the bytes.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn slice(&mut self, length: usize) -> Result<&'a [u8], BytesError> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or(BytesError::Damaged { what: "it is cut off" })?;
        self.0 = rest;
        Ok(taken)
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], BytesError> {
        let mut taken = [0; N];
        taken.copy_from_slice(self.slice(N)?);
        Ok(taken)
    }

    fn sum(&mut self) -> Result<ExactSum, BytesError> {
        let [sign, first, count] = self.take()?;
        let limbs = self.slice(4 * usize::from(count))?;
        let limbs = limbs.as_chunks::<4>().0.iter().map(|limb| u32::from_le_bytes(*limb)).collect();
        let written = Canonical { negative: sign == 1, first: usize::from(first), limbs };
        let sum = if sign <= 1 && written.first < LIMBS { ExactSum::from_canonical(&written) } else { None };
        sum.ok_or(BytesError::Damaged { what: "a sum is not as it is written" })
    }
}
