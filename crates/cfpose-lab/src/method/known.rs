//! What a method knows of theta beforehand: free parameters, bounds, a prior. Names, until the model says where they stand.

use std::collections::BTreeMap;

use cfpose::bounds::{Bound, Bounds};
use cfpose::entry::parse_spec;
use cfpose::free::{Frame, find_columns};
use cfpose::theta::{Layout, RotationForm};
use cfpose::{BuildError, Prior, Settings};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The keys `free`, `bounds` and `prior` of a method.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Known {
    /// Names of the parameters that move; the others keep the value of the start. `None` for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub free: Option<Vec<String>>,
    /// Least and largest value by name of a parameter, angles in radians; infinite where one side is open.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub bounds: BTreeMap<String, [f64; 2]>,
    /// A theta and its covariance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorFile>,
}

/// What a prior file holds: a list of numbers, as a result of `estimate --json` writes theta, and a covariance of its tangent step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorFile {
    /// Most likely theta.
    pub theta: Vec<f64>,
    /// Covariance, rows.
    pub covariance: Vec<Vec<f64>>,
    /// How the rotation stands in theta; that of the reader where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation_form: Option<String>,
    /// Model whose result it is; any with this theta where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
}

impl Known {
    /// Put what is known into settings.
    ///
    /// # Errors
    /// The key and what is wrong: a name that the layout does not have, an empty interval, a prior that is none of this theta.
    pub fn fill(&self, layout: &Layout, settings: &mut Settings) -> Result<(), cfpose::Error> {
        let at = |key: &str, problem: String| cfpose::Error::Unsupported(format!("`{key}`: {problem}"));
        if let Some(free) = &self.free {
            let names: Vec<&str> = free.iter().map(String::as_str).collect();
            let columns = find_columns(layout, &names, Frame::Camera);
            settings.free = Some(columns.map_err(|error| at("free", words(error)))?);
        }
        for (name, [low, high]) in &self.bounds {
            let columns = find_columns(layout, &[name], Frame::Camera).map_err(|error| at("bounds", words(error)))?;
            settings.bounds.extend(columns.into_iter().map(|column| Bound { column, low: *low, high: *high }));
        }
        Bounds::new(layout, &settings.bounds).map_err(|error| at("bounds", words(error)))?;
        if let Some(prior) = &self.prior {
            let prior = prior.resolve(layout, &settings.model, RotationForm::Vector);
            settings.prior = Some(prior.map_err(|problem| at("prior", problem))?);
        }
        Ok(())
    }
}

impl PriorFile {
    /// Read the theta and the covariance of a JSON file: one of its own, or a result of `estimate --json`.
    ///
    /// ```
    /// use cfpose_lab::method::known::PriorFile;
    /// let prior = PriorFile::read(r#"{"theta": [0.5], "covariance": [[0.01]], "verdict": "good"}"#).unwrap();
    /// assert_eq!(prior.covariance, [[0.01]]);
    /// assert!(PriorFile::read("{}").unwrap_err().contains("no \"theta\""));
    /// ```
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn read(text: &str) -> Result<Self, String> {
        let value: Value = serde_json::from_str(text).map_err(|error| format!("this is no JSON: {error}"))?;
        let theta = value.get("theta").ok_or("there is no \"theta\" in it")?;
        let form = match value.get("rotation_form") {
            None => None,
            Some(Value::String(form)) => Some(form.clone()),
            Some(other) => return Err(unknown_form(&other.to_string())),
        };
        Ok(Self {
            theta: serde_json::from_value(theta.clone()).map_err(|_| "\"theta\" is no list of numbers")?,
            covariance: rows(&value)?,
            rotation_form: form,
            model: value.get("model").and_then(Value::as_str).map(str::to_string),
        })
    }

    /// Return the prior for a model; `form` is that of a theta that does not say its own.
    ///
    /// # Errors
    /// What does not fit the model, in words.
    pub fn resolve(&self, layout: &Layout, model: &str, form: RotationForm) -> Result<Prior, String> {
        let name = |spec: &str| parse_spec(spec).map_or_else(|_| spec.to_string(), |(name, _)| name);
        if let Some(other) = self.model.as_ref().filter(|other| name(other) != name(model)) {
            return Err(format!("this is a result of model `{other}`, not of `{model}`; give a theta of this model"));
        }
        let form = match &self.rotation_form {
            None => form,
            Some(text) => text.parse().map_err(|_| unknown_form(text))?,
        };
        let theta = layout.from_list(&self.theta, form).map_err(|error| error.to_string())?;
        let prior = Prior { theta, covariance: self.covariance.concat() };
        prior.check(layout).map_err(words)?;
        Ok(prior)
    }
}

fn unknown_form(text: &str) -> String {
    format!("\"rotation_form\" is {text}; it is vector, euler, euler-ORDER or quaternion")
}

/// Return the rows of "covariance".
fn rows(value: &Value) -> Result<Vec<Vec<f64>>, String> {
    let shape = "\"covariance\" has to be a list of rows of numbers";
    let rows = value.get("covariance").and_then(Value::as_array).ok_or(shape)?;
    let number = |entry: &Value| {
        let null =
            "\"covariance\" holds null: a direction that was not determined is no prior; give it a large variance";
        entry.as_f64().ok_or(if entry.is_null() { null } else { shape })
    };
    let row = |row: &Value| {
        let row = row.as_array().ok_or(shape)?;
        if row.len() != rows.len() {
            return Err(format!("a row of \"covariance\" has {} numbers, there are {} rows", row.len(), rows.len()));
        }
        Ok(row.iter().map(number).collect::<Result<Vec<f64>, _>>()?)
    };
    rows.iter().map(row).collect()
}

/// Return what is wrong, without what it was built for.
fn words(error: BuildError) -> String {
    match error {
        BuildError::Data { problem, .. } => problem,
        other => other.to_string(),
    }
}
