//! Parameter values: from TOML to one canonical text, and from there to JSON and TOML.

use serde_json::Value as Json;
use toml::Value as Toml;

/// Write a value as canonical text: numbers in their shortest form, words apart by one blank.
///
/// So `1`, `1.0` and `"1.00"` are the same value and give the same trial.
pub(crate) fn canonical(text: &str) -> String {
    let words: Vec<String> = text.split_whitespace().map(canonical_word).collect();
    words.join(" ")
}

fn canonical_word(word: &str) -> String {
    match word.parse::<f64>() {
        // + 0.0 turns -0 into 0.
        Ok(number) if number.is_finite() && !is_long_integer(word) => format!("{}", number + 0.0),
        _ => word.to_string(),
    }
}

/// Whole numbers beyond 2^53 (seeds) must not pass through a float.
fn is_long_integer(word: &str) -> bool {
    word.parse::<i128>().is_ok_and(|integer| integer.unsigned_abs() > 1 << 53)
}

/// Return the canonical text of one grid value: a number, word, truth value, or list of numbers.
pub(crate) fn text_of(value: &Toml) -> Result<String, String> {
    match value {
        Toml::String(text) => Ok(canonical(text)),
        Toml::Integer(number) => Ok(canonical(&number.to_string())),
        Toml::Float(number) if number.is_finite() => Ok(canonical(&number.to_string())),
        Toml::Float(number) => Err(format!("{number} is not a finite number")),
        Toml::Boolean(truth) => Ok(truth.to_string()),
        Toml::Array(items) => {
            let words: Result<Vec<String>, String> = items
                .iter()
                .map(|item| match item {
                    Toml::Integer(_) | Toml::Float(_) => text_of(item),
                    _ => Err("a list inside a list holds numbers only".to_string()),
                })
                .collect();
            Ok(words?.join(" "))
        }
        Toml::Datetime(_) | Toml::Table(_) => Err("expected a number, a text or a list of them".to_string()),
    }
}

/// Return canonical text as JSON: a number where it is one, else text.
pub(crate) fn json_of(text: &str) -> Json {
    if let Ok(integer) = text.parse::<i64>() {
        return Json::from(integer);
    }
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Json::from(number),
        _ => Json::from(text),
    }
}

/// Return canonical text as TOML: a number where it is one, else text.
pub(crate) fn toml_of(text: &str) -> Toml {
    if let Ok(integer) = text.parse::<i64>() {
        return Toml::Integer(integer);
    }
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Toml::Float(number),
        _ => Toml::String(text.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_values_have_equal_texts() {
        for text in ["1", "1.0", "1.00", " 1 ", "1e0"] {
            assert_eq!(canonical(text), "1");
        }
        assert_eq!(text_of(&Toml::Float(0.1)).unwrap(), "0.1");
        assert_eq!(text_of(&Toml::Integer(1)).unwrap(), text_of(&Toml::Float(1.0)).unwrap());
        let list = Toml::Array(vec![Toml::Float(0.10), Toml::Integer(-2)]);
        assert_eq!(text_of(&list).unwrap(), canonical("0.1   -2.0"));
        assert_eq!(canonical("9007199254740993"), "9007199254740993");
        assert_eq!(canonical("fourier[seed=3]"), "fourier[seed=3]");
        assert_eq!(canonical("-0.0"), "0");
        assert!(text_of(&Toml::Float(f64::NAN)).is_err());
        assert_eq!(json_of("0.1").to_string(), "0.1");
    }
}
