//! One part of a run that is split.

use std::fmt;
use std::str::FromStr;

use crate::error::LabError;

/// One part of a run that is split over processes or machines.
///
/// ```
/// use cfpose_lab::Shard;
/// let shard: Shard = "1/4".parse().unwrap();
/// assert_eq!((shard.index, shard.count), (1, 4));
/// assert!("4/4".parse::<Shard>().unwrap_err().to_string().contains("from 0"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Index, from 0.
    pub index: usize,
    /// Number of shards.
    pub count: usize,
}

impl Shard {
    /// The whole run.
    pub const WHOLE: Shard = Shard { index: 0, count: 1 };

    /// Say whether the shard computes trial number `position` of the plan.
    pub fn holds(self, position: usize) -> bool {
        position % self.count == self.index
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = LabError;

    fn from_str(text: &str) -> Result<Self, LabError> {
        let error = |problem| LabError::Shard { text: text.to_string(), problem };
        let (index, count) = text.split_once('/').ok_or_else(|| error("there is no `/`"))?;
        let number = |part: &str| part.trim().parse::<usize>().map_err(|_| error("these are not two whole numbers"));
        let (index, count) = (number(index)?, number(count)?);
        if index >= count {
            return Err(error("I counts from 0 and is below N"));
        }
        Ok(Self { index, count })
    }
}
