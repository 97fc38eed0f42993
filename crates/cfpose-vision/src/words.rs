//! What the name of a column says.

/// What a name says about its column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// Coordinate x, y or z (0, 1, 2) of a system of axes.
    Axis(System, usize),
    /// Member of a numbered family: `Points:0`, `x1`, `V2`.
    Member(String, u32),
    /// Coordinate of the normal.
    Normal(usize),
    /// What clouds have beside coordinates: intensity, colour, time, label.
    Beside,
    /// Something with a length that may be the missing coordinate.
    Suspect,
    /// Nothing that is known here.
    Unknown,
}

/// Names of axes that belong together, the first preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum System {
    /// x, y, z.
    Cartesian,
    /// Easting, northing.
    Map,
    /// Height above either of the two.
    Height,
    /// u, v: pixels.
    Pixel,
    /// Column, row: pixels.
    Raster,
}

/// Words around the name of an axis that change nothing: what is measured, and units.
const AROUND: &str = "pos position positions point points pt pts coord coords coordinate coordinates loc location vertex vertices \
    vert world local global map cartesian geometry geom center centre axis value values image img pixel pixels \
    px p r in m mm cm dm km um ft feet inch inches metre metres meter meters millimetre millimetres millimeter \
    millimeters utm xyz index idx";

/// Families whose members are the coordinates in the order of their numbers, beside those of one letter (`x1`, `V2`).
const FAMILIES: &str =
    "points point pts pt position positions pos coord coords coordinate coordinates xyz var col column field dim";

/// What clouds have beside coordinates.
const BESIDE: &str = "intensity intensities reflectance reflectivity amplitude ambient red green blue alpha r g b rgb rgba color \
    colour colors colours grey gray label labels class classification id index idx name time timestamp stamp t \
    gps return returns number ring scan scalar field confidence quality score curvature normal normals weight \
    weights w segment instance user data source original cloud angle i";

/// Lengths that may be a third coordinate under another name.
const SUSPECT: &str = "depth down range distance dist disparity lat lon lng latitude longitude z";

fn is_of(list: &str, word: &str) -> bool {
    list.split(' ').any(|known| known == word)
}

/// Split a name into lower-case words: at everything but letters and digits, between `posX` and between `x1`; what stands
/// in brackets (units) is left out.
pub(crate) fn words(name: &str) -> Vec<String> {
    let (mut words, mut word, mut depth) = (Vec::new(), String::new(), 0usize);
    let chars: Vec<char> = name.chars().take(200).collect();
    for (k, &c) in chars.iter().enumerate() {
        match c {
            '[' | '(' | '{' | '<' => depth += 1,
            ']' | ')' | '}' | '>' => depth = depth.saturating_sub(1),
            _ => {}
        }
        let before = k.checked_sub(1).map(|k| chars[k]);
        let turns = before.is_some_and(|b| {
            let upper_word = b.is_uppercase() && c.is_uppercase() && chars.get(k + 1).is_some_and(|n| n.is_lowercase());
            b.is_lowercase() && c.is_uppercase() || b.is_numeric() != c.is_numeric() || upper_word
        });
        let inside = depth > 0 || !c.is_alphanumeric();
        if (inside || turns) && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        if !inside {
            word.extend(c.to_lowercase());
        }
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

/// Return what a name says about its column.
///
/// What stands in brackets, and words such as `pos`, `point` or a unit around the axis, change nothing.
pub(crate) fn meaning(name: &str) -> Meaning {
    let words = words(name);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    if let Some(normal) = normal(&words) {
        return Meaning::Normal(normal);
    }
    if let [word] = words[..]
        && let Some((system, axis)) = axis(word)
    {
        return Meaning::Axis(system, axis);
    }
    let (family, number) = match words[..] {
        [number] => ("", number),
        [family, number] => (family, number),
        _ => ("", ""),
    };
    if let Ok(number) = number.parse::<u32>()
        && (family.len() < 2 || is_of(FAMILIES, family))
    {
        return Meaning::Member(family.to_string(), number);
    }
    if let [letter @ ("a" | "b" | "c")] = words[..] {
        return Meaning::Member("letter".into(), u32::from(letter.as_bytes()[0] - b'a'));
    }
    if !words.is_empty() && words.iter().all(|word| is_of(BESIDE, word) || word.parse::<u32>().is_ok()) {
        return Meaning::Beside;
    }
    let left: Vec<&str> = words.iter().filter(|word| !is_of(AROUND, word)).copied().collect();
    match left[..] {
        [word] => match axis(word) {
            // Names of one letter that are also units or counts stand alone.
            Some((system, axis)) if !["e", "n", "h"].contains(&word) => Meaning::Axis(system, axis),
            _ if is_of(SUSPECT, word) => Meaning::Suspect,
            _ => Meaning::Unknown,
        },
        _ if words.iter().any(|word| is_of(SUSPECT, word)) => Meaning::Suspect,
        _ => Meaning::Unknown,
    }
}

fn axis(word: &str) -> Option<(System, usize)> {
    Some(match word {
        "x" => (System::Cartesian, 0),
        "y" => (System::Cartesian, 1),
        "z" => (System::Cartesian, 2),
        "easting" | "east" | "e" => (System::Map, 0),
        "northing" | "north" | "n" => (System::Map, 1),
        "height" | "elevation" | "elev" | "altitude" | "alt" | "up" | "h" => (System::Height, 2),
        "u" => (System::Pixel, 0),
        "v" => (System::Pixel, 1),
        "col" | "column" | "cols" => (System::Raster, 0),
        "row" | "rows" => (System::Raster, 1),
        _ => return None,
    })
}

/// Return the coordinate of a normal: `nx`, `normal_y`, `Normals:2`.
fn normal(words: &[&str]) -> Option<usize> {
    let axis = match *words {
        ["n" | "normal" | "normals", axis] => axis,
        ["nx" | "normalx"] => "x",
        ["ny" | "normaly"] => "y",
        ["nz" | "normalz"] => "z",
        _ => return None,
    };
    ["x", "y", "z"].iter().position(|name| *name == axis).or_else(|| axis.parse().ok().filter(|axis| *axis < 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_units_and_words_around_them_are_understood() {
        use System::*;
        for (name, system, axis) in [
            ("x", Cartesian, 0),
            ("Y", Cartesian, 1),
            ("z [m]", Cartesian, 2),
            ("x(mm)", Cartesian, 0),
            ("pos_y", Cartesian, 1),
            ("posZ", Cartesian, 2),
            ("position.x", Cartesian, 0),
            ("XCoord", Cartesian, 0),
            ("Y Coordinate", Cartesian, 1),
            ("z_m", Cartesian, 2),
            ("x in mm", Cartesian, 0),
            ("Easting (m)", Map, 0),
            ("NORTHING", Map, 1),
            ("E", Map, 0),
            ("height", Height, 2),
            ("Elevation_m", Height, 2),
            ("u [px]", Pixel, 0),
            ("pixel_v", Pixel, 1),
            ("col", Raster, 0),
            ("Row", Raster, 1),
            ("row_index", Raster, 1),
        ] {
            assert_eq!(meaning(name), Meaning::Axis(system, axis), "{name}");
        }
        assert_eq!(meaning("Points:1"), Meaning::Member("points".into(), 1));
        assert_eq!(meaning("V3"), Meaning::Member("v".into(), 3));
        assert_eq!(meaning("b"), Meaning::Member("letter".into(), 1));
        for (name, axis) in [("nx", 0), ("Ny", 1), ("normal_z", 2), ("Normals:1", 1), ("normalX", 0), ("n_y", 1)] {
            assert_eq!(meaning(name), Meaning::Normal(axis), "{name}");
        }
        for name in ["intensity", "R", "rgb", "label", "Scalar field", "GPS_Time", "weight"] {
            assert_eq!(meaning(name), Meaning::Beside, "{name}");
        }
        for name in ["velocity_x", "target_x", "gt x", "foo", "", "x2y"] {
            assert_eq!(meaning(name), Meaning::Unknown, "{name}");
        }
        assert_eq!(meaning("depth [m]"), Meaning::Suspect);
        assert_eq!(meaning("lat"), Meaning::Suspect);
    }
}
