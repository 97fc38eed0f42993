//! Which columns of a file are coordinates, weight and normal.

use std::collections::BTreeMap;

use crate::error::{Fault, excerpt};
use crate::options::ReadOptions;
use crate::words::{Meaning, System, meaning};

/// Most columns of a row: a line of a hundred thousand names is no table.
pub(crate) const MOST_COLUMNS: usize = 1024;

/// Which columns of a row are the coordinates, the weight and the normal, each with the name that messages give it.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    /// Coordinates.
    pub coordinates: Vec<(usize, String)>,
    /// Weight.
    pub weight: Option<(usize, String)>,
    /// Normal: none, or as many as there are coordinates.
    pub normal: Vec<(usize, String)>,
    /// Names of columns that are not read.
    pub ignored: Vec<String>,
}

impl Layout {
    /// Choose among named columns.
    ///
    /// `w` is the weight. With a column `x` the coordinates are `x`, `y`, `z` wherever they stand, whatever units and words
    /// surround the letters; else easting, northing and height; else u, v; else column, row; else a numbered family such as
    /// `Points:0`. Names that say nothing are refused, save a single column. `numeric` says which columns can be offered as
    /// a choice.
    pub(crate) fn by_name(
        names: &[String],
        options: &ReadOptions,
        numeric: impl Fn(usize) -> bool,
    ) -> Result<Self, Fault> {
        if !options.columns.is_empty() {
            return Self::chosen(names, names.len(), options);
        }
        let weight = weight(names, options)?;
        let meanings: Vec<Meaning> = names.iter().map(|name| meaning(name)).collect();
        let offer = || offer(names.len(), |index| numeric(index) && Some(index) != weight);
        let of_weight = weight.filter(|_| options.weight_column.is_none());
        let chosen = match axes(names, &meanings, weight)? {
            Some(chosen) => {
                // Two coordinates beside what may be the third under a name that is not understood.
                let suspect = |k: usize| meanings[k] == Meaning::Suspect && !chosen.contains(&k);
                if chosen.len() == 2 && (0..names.len()).any(suspect) {
                    return Err(unnamed(names, offer()));
                }
                if of_weight.is_some() && matches!(meanings[chosen[0]], Meaning::Axis(System::Pixel, _)) {
                    return Err(Fault::ThirdOrWeight);
                }
                chosen
            }
            None => match (0..names.len()).filter(|k| Some(*k) != weight).collect::<Vec<usize>>() {
                single if single.len() < 2 => single,
                _ => return Err(unnamed(names, offer())),
            },
        };
        Self::complete(names, chosen, weight, &meanings)
    }

    /// Choose the columns of a format whose coordinates are called `x`, `y` and `z`.
    pub(crate) fn by_xyz(names: &[String], what: &str, options: &ReadOptions) -> Result<Self, Fault> {
        if !options.columns.is_empty() {
            return Self::chosen(names, names.len(), options);
        }
        let exact = |wanted: &str| find_once(names, wanted);
        let weight = weight(names, options)?;
        let xyz = [exact("x")?, exact("y")?, exact("z")?];
        if xyz[0].is_none() {
            return Err(Fault::Header { what: format!("names no {what} x") });
        }
        check_gap(&xyz)?;
        let meanings: Vec<Meaning> = names.iter().map(|name| meaning(name)).collect();
        Self::complete(names, xyz.into_iter().flatten().collect(), weight, &meanings)
    }

    /// Take the columns of a file without names.
    pub(crate) fn anonymous(
        columns: usize,
        options: &ReadOptions,
        numeric: impl Fn(usize) -> bool,
    ) -> Result<Self, Fault> {
        let names: Vec<String> = vec![String::new(); columns.min(MOST_COLUMNS)];
        if !options.columns.is_empty() || columns > MOST_COLUMNS {
            return Self::chosen(&names, columns, options);
        }
        let weight = options.weight_column.as_deref().map(|wanted| find(&names, columns, wanted)).transpose()?;
        let chosen: Vec<usize> = (0..columns).filter(|k| Some(*k) != weight).collect();
        if chosen.len() > 3 {
            return Err(Fault::Dimension {
                found: columns,
                columns: offer(columns, |k| numeric(k) && Some(k) != weight),
            });
        }
        let axis = |(axis, index): (usize, usize)| (index, ["x", "y", "z"][axis].to_string());
        Self::checked(chosen.into_iter().enumerate().map(axis).collect(), weight.map(|k| (k, "w".to_string())))
    }

    /// Take the coordinates of a format that always has these.
    pub(crate) fn fixed(names: &[&str], options: &ReadOptions) -> Result<Self, Fault> {
        let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
        Self::by_xyz(&names, "column", options)
    }

    /// Take x, y and z, the first three of the columns that a format fixes; the others are ignored.
    pub(crate) fn first_three(columns: usize, options: &ReadOptions) -> Result<Self, Fault> {
        if !options.columns.is_empty() || options.weight_column.is_some() || columns < 4 {
            return Self::anonymous(columns, options, |_| true);
        }
        let layout = Self::anonymous(3, options, |_| true)?;
        let ignored = (3..columns).map(|index| format!("column {}", index + 1)).collect();
        Ok(Self { ignored, ..layout })
    }

    /// Take the columns that were asked for.
    fn chosen(names: &[String], columns: usize, options: &ReadOptions) -> Result<Self, Fault> {
        let found = options.columns.len();
        if columns > MOST_COLUMNS || found == 0 || found > 3 {
            return Err(Fault::Dimension { found: if found > 3 { found } else { columns }, columns: None });
        }
        let places: Vec<usize> =
            options.columns.iter().map(|wanted| find(names, columns, wanted)).collect::<Result<_, Fault>>()?;
        let twice = (1..found).find(|k| places[..*k].contains(&places[*k]));
        if let Some(k) = twice {
            return Err(Fault::ColumnTwice { wanted: excerpt(&options.columns[k]) });
        }
        let weight = match &options.weight_column {
            Some(wanted) => Some(find(names, columns, wanted)?),
            None => find_once(names, "w")?.filter(|index| !places.contains(index)),
        };
        if let Some(wanted) = options.weight_column.as_ref().filter(|_| weight.is_some_and(|w| places.contains(&w))) {
            return Err(Fault::ColumnTwice { wanted: excerpt(wanted) });
        }
        let meanings: Vec<Meaning> = names.iter().map(|name| meaning(name)).collect();
        Self::complete(names, places, weight, &meanings)
    }

    /// Add the normal, and the names of what is left.
    fn complete(
        names: &[String],
        coordinates: Vec<usize>,
        weight: Option<usize>,
        meanings: &[Meaning],
    ) -> Result<Self, Fault> {
        // Names appear in messages of one line.
        let shown = |index: usize| match names[index].trim() {
            "" => format!("column {}", index + 1),
            name => excerpt(name).escape_debug().to_string(),
        };
        let place = |axis: usize| (0..names.len()).find(|k| meanings[*k] == Meaning::Normal(axis));
        let normal: Vec<usize> = (0..coordinates.len()).filter_map(place).collect();
        let normal = if coordinates.len() < 2 || normal.len() < coordinates.len() { Vec::new() } else { normal };
        let read = |k: &usize| coordinates.contains(k) || normal.contains(k) || weight == Some(*k);
        let left = (0..names.len()).filter(|k| !read(k) && names[*k].contains(char::is_alphanumeric));
        let ignored = left.map(shown).collect();
        let named = |index: usize| (index, shown(index));
        let layout = Self::checked(coordinates.iter().map(|k| named(*k)).collect(), weight.map(named))?;
        Ok(Self { normal: normal.into_iter().map(named).collect(), ignored, ..layout })
    }

    fn checked(coordinates: Vec<(usize, String)>, weight: Option<(usize, String)>) -> Result<Self, Fault> {
        match coordinates.len() {
            0 => Err(Fault::Header { what: "names a weight and no coordinate".to_string() }),
            1..=3 => Ok(Self { coordinates, weight, normal: Vec::new(), ignored: Vec::new() }),
            found => Err(Fault::Dimension { found, columns: None }),
        }
    }

    /// Return the columns that are read.
    pub(crate) fn read(&self) -> impl Iterator<Item = usize> {
        self.coordinates.iter().chain(&self.weight).chain(&self.normal).map(|(index, _)| *index)
    }
}

/// Say whether every name of a comment is known, and one of them is an axis: it is then a header.
pub(crate) fn is_header(names: &[&str]) -> bool {
    let meanings: Vec<Meaning> = names.iter().map(|name| meaning(name)).collect();
    let known = |m: &Meaning| match m {
        Meaning::Member(family, _) => family != "letter" && !family.is_empty(),
        Meaning::Unknown | Meaning::Suspect => false,
        _ => true,
    };
    meanings.iter().all(known) && meanings.iter().any(|m| matches!(m, Meaning::Axis(_, 0) | Meaning::Member(_, 0 | 1)))
}

/// Find the coordinates by what the names mean; `None` where they mean nothing.
fn axes(names: &[String], meanings: &[Meaning], weight: Option<usize>) -> Result<Option<Vec<usize>>, Fault> {
    let axis = |system: System, axis: usize| -> Result<Option<usize>, Fault> {
        let letter = ["x", "y", "z"][axis];
        if system == System::Cartesian
            && let Some(exact) = find_once(names, letter)?
        {
            return Ok(Some(exact));
        }
        let mut places = (0..names.len()).filter(|k| Some(*k) != weight && meanings[*k] == Meaning::Axis(system, axis));
        match (places.next(), places.next()) {
            (Some(_), Some(_)) => Err(Fault::Header { what: format!("names {letter} twice") }),
            (place, _) => Ok(place),
        }
    };
    let xyz = [axis(System::Cartesian, 0)?, axis(System::Cartesian, 1)?, axis(System::Cartesian, 2)?];
    if xyz[0].is_some() || xyz[1].is_some() {
        let height = if xyz[0].is_some() && xyz[1].is_some() { axis(System::Height, 2)? } else { None };
        let xyz = [xyz[0], xyz[1], xyz[2].or(height)];
        if names.len() - usize::from(weight.is_some()) == 1 {
            return Ok(None);
        }
        check_gap(&xyz)?;
        return Ok(Some(xyz.into_iter().flatten().collect()));
    }
    for system in [System::Map, System::Pixel, System::Raster] {
        if let (Some(first), Some(second)) = (axis(system, 0)?, axis(system, 1)?) {
            let third = if system == System::Map { axis(System::Height, 2)?.or(xyz[2]) } else { None };
            return Ok(Some([Some(first), Some(second), third].into_iter().flatten().collect()));
        }
    }
    Ok(family(meanings))
}

/// Find the one numbered family, its members 1 to 3 and numbered from 0 or 1 without a gap; one with a word for its name is
/// preferred to those of one letter.
fn family(meanings: &[Meaning]) -> Option<Vec<usize>> {
    let mut families: BTreeMap<&str, Vec<(u32, usize)>> = BTreeMap::new();
    for (place, meaning) in meanings.iter().enumerate() {
        if let Meaning::Member(family, number) = meaning {
            families.entry(family).or_default().push((*number, place));
        }
    }
    if families.keys().any(|name| name.len() > 1) {
        families.retain(|name, _| name.len() > 1);
    }
    let mut members = families.into_values();
    let (mut members, None) = (members.next()?, members.next()) else { return None };
    members.sort_unstable();
    let first = members[0].0;
    if first > 1 || members.len() > 3 {
        return None;
    }
    let whole = members.iter().zip(first..).all(|(member, number)| member.0 == number);
    whole.then(|| members.iter().map(|member| member.1).collect())
}

/// Refuse coordinates that leave one out.
fn check_gap(xyz: &[Option<usize>; 3]) -> Result<(), Fault> {
    let what = match xyz {
        [Some(_), None, Some(_)] => "names x and z and no y",
        [None, ..] => "names y and no x",
        _ => return Ok(()),
    };
    Err(Fault::Header { what: what.to_string() })
}

fn weight(names: &[String], options: &ReadOptions) -> Result<Option<usize>, Fault> {
    match &options.weight_column {
        Some(wanted) => find(names, names.len(), wanted).map(Some),
        None => find_once(names, "w"),
    }
}

/// Find a name, without regard to case, that may stand once.
fn find_once(names: &[String], wanted: &str) -> Result<Option<usize>, Fault> {
    let mut places = (0..names.len()).filter(|k| names[*k].trim().eq_ignore_ascii_case(wanted));
    match (places.next(), places.next()) {
        (Some(_), Some(_)) => Err(Fault::Header { what: format!("names {} twice", excerpt(wanted)) }),
        (place, _) => Ok(place),
    }
}

/// Find a column that was asked for: by its name, else by its number from 1.
fn find(names: &[String], columns: usize, wanted: &str) -> Result<usize, Fault> {
    let wanted = wanted.trim();
    if let Some(exact) = names.iter().position(|name| !name.is_empty() && name.trim() == wanted) {
        return Ok(exact);
    }
    if !wanted.is_empty()
        && let Some(place) = find_once(names, wanted)?
    {
        return Ok(place);
    }
    let number = wanted.parse::<usize>().ok().filter(|number| (1..=columns).contains(number));
    number.map(|number| number - 1).ok_or_else(|| {
        let named: Vec<String> = names.iter().filter(|name| !name.trim().is_empty()).take(12).cloned().collect();
        let known = match named.is_empty() {
            true => format!("name columns by their numbers, 1 to {columns}"),
            false => format!("the file names {}", list(&named)),
        };
        Fault::NoColumn { wanted: excerpt(wanted), known }
    })
}

/// Offer up to three columns to choose, by number.
fn offer(columns: usize, can: impl Fn(usize) -> bool) -> Option<String> {
    let numbers: Vec<String> = (0..columns).filter(|k| can(*k)).take(3).map(|k| (k + 1).to_string()).collect();
    (!numbers.is_empty()).then(|| numbers.join(","))
}

fn unnamed(names: &[String], columns: Option<String>) -> Fault {
    Fault::Unnamed { names: list(names), columns }
}

/// Write names as a list of readable length.
pub(crate) fn list(names: &[String]) -> String {
    let quoted = |name: &String| name.trim().chars().take(16).collect::<String>().escape_debug().to_string();
    let mut text = names.iter().take(8).map(quoted).collect::<Vec<String>>().join(", ");
    if names.len() > 8 {
        text.push_str(", ...");
    }
    text
}
