//! Parameters of scenarios that vary from trial to trial: `{low..high}` and `{seed}` inside a text, lists of texts.

use cfpose_lab::ChaCha12Rng;
use cfpose_lab::rand::RngExt;

/// Which part of the seeds a trial takes: the parts never meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// `{seed}` is 1 to 5999.
    Training,
    /// `{seed}` is 6000 to 8999. Seeds from 9000 are left for tests: nothing here draws them.
    Validation,
}

impl Split {
    /// Return the first seed and the number of seeds.
    fn seeds(self) -> (i64, i64) {
        match self {
            Split::Training => (1, 5999),
            Split::Validation => (6000, 3000),
        }
    }
}

/// One way a text continues.
#[derive(Debug, Clone, PartialEq)]
enum Part {
    Fixed(String),
    Seed,
    /// Whole numbers, both ends included.
    Whole(i64, i64),
    Real(f64, f64),
}

/// A value of a parameter: one of several templates, each with equal chance.
#[derive(Debug, Clone, PartialEq)]
pub struct Varied {
    choices: Vec<Vec<Part>>,
}

impl Varied {
    /// Read templates.
    ///
    /// # Errors
    /// What is wrong with a brace.
    pub fn new(texts: &[String]) -> Result<Self, String> {
        if texts.is_empty() {
            return Err("the list is empty".to_string());
        }
        let choices = texts.iter().map(|text| parts(text)).collect::<Result<_, _>>()?;
        Ok(Self { choices })
    }

    /// Draw a value.
    pub fn draw(&self, split: Split, rng: &mut ChaCha12Rng) -> String {
        let choice = if self.choices.len() > 1 { rng.random_range(0..self.choices.len()) } else { 0 };
        let mut text = String::new();
        for part in &self.choices[choice] {
            match part {
                Part::Fixed(fixed) => text.push_str(fixed),
                Part::Seed => {
                    let (first, count) = split.seeds();
                    text.push_str(&rng.random_range(first..first + count).to_string());
                }
                Part::Whole(low, high) => text.push_str(&rng.random_range(*low..=*high).to_string()),
                Part::Real(low, high) => text.push_str(&(low + (high - low) * rng.random::<f64>()).to_string()),
            }
        }
        text
    }
}

/// Split a template at its braces.
fn parts(text: &str) -> Result<Vec<Part>, String> {
    let (mut found, mut rest) = (Vec::new(), text);
    while let Some((before, after)) = rest.split_once('{') {
        let (inside, behind) = after.split_once('}').ok_or_else(|| format!("`{text}`: a brace is not closed"))?;
        found.push(Part::Fixed(before.to_string()));
        found.push(range(inside).ok_or_else(|| format!("`{{{inside}}}`: expected {{seed}} or {{low..high}}"))?);
        rest = behind;
    }
    found.push(Part::Fixed(rest.to_string()));
    Ok(found)
}

fn range(inside: &str) -> Option<Part> {
    if inside == "seed" {
        return Some(Part::Seed);
    }
    let (low, high) = inside.split_once("..")?;
    if let (Ok(low), Ok(high)) = (low.parse::<i64>(), high.parse::<i64>()) {
        return (low <= high).then_some(Part::Whole(low, high));
    }
    let (low, high): (f64, f64) = (low.parse().ok()?, high.parse().ok()?);
    (low <= high && low.is_finite() && high.is_finite()).then_some(Part::Real(low, high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use cfpose_lab::seed::data_stream;

    #[test]
    fn seeds_of_training_validation_and_tests_never_meet() {
        let varied = Varied::new(&["{seed}".to_string()]).unwrap();
        let draws = |split| {
            let mut rng = data_stream(1, 2);
            (0..20_000).map(|_| varied.draw(split, &mut rng).parse::<u32>().unwrap()).collect::<Vec<_>>()
        };
        let (training, validation) = (draws(Split::Training), draws(Split::Validation));
        assert!(training.iter().all(|s| (1..6000).contains(s)) && training.contains(&1) && training.contains(&5999));
        assert!(validation.iter().all(|s| (6000..9000).contains(s)) && validation.contains(&8999));
    }

    #[test]
    fn templates_are_filled_in_and_mistakes_named() {
        let varied = Varied::new(&["fourier[seed={3..3},amplitude={0.25..0.25}]".to_string()]).unwrap();
        assert_eq!(varied.draw(Split::Training, &mut data_stream(1, 1)), "fourier[seed=3,amplitude=0.25]");
        let lists = Varied::new(&["a".to_string(), "b".to_string()]).unwrap();
        let mut rng = data_stream(1, 1);
        let drawn: Vec<String> = (0..20).map(|_| lists.draw(Split::Training, &mut rng)).collect();
        assert!(drawn.contains(&"a".to_string()) && drawn.contains(&"b".to_string()));
        for (text, problem) in
            [("{", "not closed"), ("{3..1}", "expected"), ("{x}", "expected"), ("{1..inf}", "expected")]
        {
            assert!(Varied::new(&[text.to_string()]).unwrap_err().contains(problem), "{text}");
        }
    }
}
