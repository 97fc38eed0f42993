//! Camera files: OpenCV (YAML, XML), ROS camera_info, Kalibr camchain, ORB-SLAM settings, JSON.
//!
//! They all are maps of names; what a file is follows from the names in it, not from its extension. `serde_json::Value` is the form
//! that YAML, XML and JSON are brought to first.

use std::io::Read;
use std::path::Path;

use serde_json::{Map, Value};

use super::{Camera, Lens, xml, yaml};
use crate::error::{Fault, FileError, Flaw, one_line};

/// Largest file: a calibration is a few hundred numbers.
const MAX_BYTES: u64 = 1 << 20;

/// Names of a camera matrix.
const MATRIX: &[&str] =
    &["camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "intrinsic_matrix", "K", "k", "mtx"];

/// Names of the coefficients of a lens.
const COEFFICIENTS: &[&str] = &[
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distortion_coeffs",
    "distCoeffs",
    "dist_coeffs",
    "dist_coeff",
    "distortion",
    "D",
    "d",
    "dist",
];

/// Names of matrix and coefficients of the first camera of a pair; the second has a 2 in their place.
const PAIRS: &[(&str, &str)] =
    &[("M1", "D1"), ("K1", "D1"), ("cameraMatrix1", "distCoeffs1"), ("camera_matrix_1", "distortion_coefficients_1")];

/// Read a camera file: OpenCV (yaml, xml), ROS camera_info, Kalibr camchain, ORB-SLAM, or JSON with fx, fy, cx, cy and, where there is
/// a lens, `distortion_model` (`plumb_bob`, `equidistant`, ..) and `distortion`.
///
/// `choice` names one of several cameras (`cam0`).
///
/// # Errors
/// [`FileError`] for a file that cannot be read, holds no camera, or holds several and none is chosen.
///
/// ```
/// let path = std::env::temp_dir().join(format!("cfpose-doc-camera-{}.yaml", std::process::id()));
/// std::fs::write(&path, "cam0:\n  camera_model: pinhole\n  intrinsics: [460.0, 458.0, 367.0, 248.0]\n")?;
/// let camera = cfpose_vision::read_camera(&path, None)?;
/// assert_eq!((camera.intrinsics().fx, camera.lens()), (460.0, cfpose_vision::Lens::None));
/// # std::fs::remove_file(&path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_camera(path: &Path, choice: Option<&str>) -> Result<Camera, FileError> {
    let fail = |fault: Fault| Flaw::from(fault).in_file(path);
    let file = std::fs::File::open(path).map_err(|error| fail(error.into()))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|error| fail(Fault::Io(error)))?;
    parse_camera(&bytes, choice).map_err(fail)
}

/// Read a camera from the content of a file.
pub(crate) fn parse_camera(bytes: &[u8], choice: Option<&str>) -> Result<Camera, Fault> {
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Fault::Camera { what: format!("the file is larger than {MAX_BYTES} bytes") });
    }
    let fault = |what: String| Fault::Camera { what: one_line(&what) };
    let text = std::str::from_utf8(bytes).map_err(|_| fault("the file is no UTF-8 text".to_string()))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let value = match text.trim_start().as_bytes().first() {
        Some(b'<') => xml::parse(text),
        Some(b'{') => serde_json::from_str(text).or_else(|error| {
            // A map of YAML in braces; what is neither is told as JSON.
            yaml::parse(text).map_err(|_| format!("line {}: this is no JSON: {error}", error.line()))
        }),
        _ => yaml::parse(text),
    };
    let value = value.map_err(fault)?;
    let map = value.as_object().ok_or_else(|| fault("the file is no map of names".to_string()))?;
    chosen(map, choice)
}

/// Find the camera of a file.
fn chosen(map: &Map<String, Value>, choice: Option<&str>) -> Result<Camera, Fault> {
    let cameras = named(map);
    let fault = |what: String| Fault::Camera { what };
    let names: Vec<&str> = cameras.iter().map(|(name, _)| name.as_str()).collect();
    match (cameras.as_slice(), choice) {
        ([], None) => single(map).map_err(fault),
        ([], Some(choice)) => Err(Fault::CameraChoice {
            what: format!("there is no camera {choice:?}, only one without a name"),
            names: String::new(),
        }),
        ([(_, only)], None) => single(only).map_err(fault),
        (all, Some(choice)) => match all.iter().find(|(name, _)| name == choice) {
            Some((_, camera)) => single(camera).map_err(fault),
            None => {
                Err(Fault::CameraChoice { what: format!("there is no camera {choice:?}"), names: names.join(" or #") })
            }
        },
        (_, None) => {
            Err(Fault::CameraChoice { what: "the file holds several cameras".to_string(), names: names.join(" or #") })
        }
    }
}

/// Return the cameras that have names: those of a Kalibr chain, or a stereo pair.
fn named(map: &Map<String, Value>) -> Vec<(String, Map<String, Value>)> {
    let is_camera = |value: &Value| value.as_object().is_some_and(|inner| inner.contains_key("intrinsics"));
    let chain: Vec<_> = map
        .iter()
        .filter(|(_, value)| is_camera(value))
        .filter_map(|(name, value)| Some((name.clone(), value.as_object()?.clone())))
        .collect();
    if !chain.is_empty() {
        return chain;
    }
    let pair =
        PAIRS.iter().find(|(matrix, _)| map.contains_key(*matrix) && map.contains_key(&matrix.replace('1', "2")));
    let Some((matrix, lens)) = pair else { return Vec::new() };
    let one = |number: &str| {
        let mut camera = Map::new();
        for (name, own) in [("camera_matrix", matrix), ("distortion_coefficients", lens)] {
            if let Some(value) = map.get(&own.replace('1', number)) {
                camera.insert(name.to_string(), value.clone());
            }
        }
        (number.to_string(), camera)
    };
    vec![one("1"), one("2")]
}

/// Read one camera.
fn single(map: &Map<String, Value>) -> Result<Camera, String> {
    let (numbers, coefficients) = if let Some(intrinsics) = map.get("intrinsics") {
        let model = text(map, &["camera_model"]).unwrap_or_default();
        if !["", "pinhole"].contains(&model.as_str()) {
            return Err(format!("the camera model {model:?} is not supported, only pinhole"));
        }
        (of_length::<4>(intrinsics, "intrinsics")?, find(map, COEFFICIENTS)?)
    } else if let Some(prefix) = ["Camera.", "Camera1.", ""].into_iter().find(|p| map.contains_key(&format!("{p}fx"))) {
        let number = |name: &str| {
            let name = format!("{prefix}{name}");
            map.get(&name).and_then(Value::as_f64).ok_or_else(|| format!("{name} is missing or no number"))
        };
        let numbers = [number("fx")?, number("fy")?, number("cx")?, number("cy")?];
        let lens = if prefix.is_empty() { find(map, COEFFICIENTS)? } else { orb_slam(map, prefix) };
        (numbers, lens)
    } else {
        let matrix = find(map, MATRIX)?.ok_or("there is no camera in it")?;
        (of_matrix(&matrix)?, find(map, COEFFICIENTS)?)
    };
    let [fx, fy, cx, cy] = numbers;
    let camera = Camera::new(fx, fy, cx, cy)
        .ok_or_else(|| format!("fx, fy, cx, cy are {fx}, {fy}, {cx}, {cy}; focal lengths are above 0"))?;
    Ok(camera.with_lens(lens(map, coefficients.as_ref())?).with_size(size(map)))
}

/// Return the size of the images, where the file names one.
fn size(map: &Map<String, Value>) -> Option<[usize; 2]> {
    let pairs = [("image_width", "image_height"), ("width", "height"), ("Camera.width", "Camera.height")];
    let number = |value: &Value| Some(*list(value).ok()?.first()? as usize).filter(|size| *size > 0);
    let named = pairs.into_iter().find_map(|(w, h)| Some([number(map.get(w)?)?, number(map.get(h)?)?]));
    named.or_else(|| {
        let [w, h] = of_length::<2>(map.get("resolution")?, "resolution").ok()?;
        (w >= 1.0 && h >= 1.0).then_some([w as usize, h as usize])
    })
}

/// Return the one of several names that is there.
fn find(map: &Map<String, Value>, names: &[&str]) -> Result<Option<Value>, String> {
    let mut there = names.iter().filter(|name| map.get(**name).is_some_and(|value| !value.is_null()));
    match (there.next(), there.next()) {
        (Some(one), Some(other)) => Err(format!("{one} and {other} are both in it")),
        (one, _) => Ok(one.map(|name| map[*name].clone())),
    }
}

fn text(map: &Map<String, Value>, names: &[&str]) -> Option<String> {
    names.iter().find_map(|name| map.get(*name)?.as_str()).map(|text| text.trim().to_lowercase())
}

/// Collect the coefficients of an ORB-SLAM file in the order of their model.
fn orb_slam(map: &Map<String, Value>, prefix: &str) -> Option<Value> {
    let fisheye = text(map, &["Camera.type"]).is_some_and(|kind| kind.starts_with("kannala"));
    let names: &[&str] = if fisheye { &["k1", "k2", "k3", "k4"] } else { &["k1", "k2", "p1", "p2", "k3"] };
    let values: Vec<Value> =
        names.iter().map(|name| map.get(&format!("{prefix}{name}")).cloned().unwrap_or(Value::from(0.0))).collect();
    Some(Value::Array(values))
}

/// Read the lens by its model and coefficients.
fn lens(map: &Map<String, Value>, coefficients: Option<&Value>) -> Result<Lens, String> {
    let fisheye = map.get("fisheye_model").is_some_and(|value| list(value).is_ok_and(|list| list == [1.0]));
    let model = text(map, &["distortion_model", "Camera.type"]).unwrap_or_default();
    let values = coefficients.map_or(Ok(Vec::new()), list).map_err(|problem| format!("distortion: {problem}"))?;
    let equidistant =
        fisheye || ["equidistant", "fisheye", "kannala_brandt", "kannalabrandt8"].contains(&model.as_str());
    if model == "none" || values.is_empty() {
        return Ok(Lens::None);
    }
    if equidistant {
        let four: [f64; 4] = values.try_into().map_err(|_| "an equidistant lens has 4 coefficients".to_string())?;
        return Lens::equidistant(four).ok_or_else(|| "a coefficient of the lens is not finite".to_string());
    }
    if !["", "plumb_bob", "rational_polynomial", "radtan", "pinhole", "opencv"].contains(&model.as_str()) {
        return Err(format!(
            "the distortion model {model:?} is not supported, only plumb_bob, rational_polynomial, radtan, equidistant"
        ));
    }
    Lens::polynomial(&values).ok_or_else(|| {
        format!("the lens has {} coefficients; 4, 5, 8 or 12 finite ones are possible, and no tilt", values.len())
    })
}

/// Read fx, fy, cx, cy of a matrix [fx 0 cx; 0 fy cy; 0 0 1].
fn of_matrix(value: &Value) -> Result<[f64; 4], String> {
    let [fx, skew, cx, a, fy, cy, b, c, one] = of_length::<9>(value, "the camera matrix")?;
    if [skew, a, b, c, one - 1.0].iter().any(|v| v.abs() > 1e-9 * fx.abs().max(1.0)) {
        return Err("the camera matrix is not fx 0 cx, 0 fy cy, 0 0 1".to_string());
    }
    Ok([fx, fy, cx, cy])
}

fn of_length<const N: usize>(value: &Value, name: &str) -> Result<[f64; N], String> {
    let list = list(value).map_err(|problem| format!("{name}: {problem}"))?;
    let found = list.len();
    list.try_into().map_err(|_| format!("{name} has {found} number(s), not {N}"))
}

/// Read numbers: a list, rows of a matrix, text with blanks, or OpenCV's and ROS's rows, cols, data.
fn list(value: &Value) -> Result<Vec<f64>, String> {
    match value {
        Value::Number(number) => Ok(vec![number.as_f64().unwrap_or(f64::NAN)]),
        Value::String(text) => text.split_whitespace().map(number).collect(),
        Value::Array(items) => {
            let parts: Result<Vec<Vec<f64>>, String> = items
                .iter()
                .map(|item| if item.is_object() { Err("a list of maps".to_string()) } else { list(item) })
                .collect();
            Ok(parts?.concat())
        }
        Value::Object(map) => {
            let data = list(map.get("data").ok_or("there is no data in it")?)?;
            let size =
                |name: &str| map.get(name).map(|size| list(size).map(|list| list.first().copied().unwrap_or(f64::NAN)));
            if let (Some(rows), Some(cols)) = (size("rows"), size("cols")) {
                let (rows, cols) = (rows?, cols?);
                if rows * cols != data.len() as f64 {
                    return Err(format!("rows {rows} and cols {cols} contradict {} numbers", data.len()));
                }
            }
            Ok(data)
        }
        Value::Null | Value::Bool(_) => Err("this is no number".to_string()),
    }
}

fn number(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|v: &f64| v.is_finite())
        .ok_or_else(|| format!("{:?} is no number", crate::error::excerpt(text)))
}
