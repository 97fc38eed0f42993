//! Shifts of a pattern in its plane under which most of its outline falls on itself: a pose that is off by one of them fits nearly as well.

use super::fit::Schedule;
use super::pattern::{Outline, Pattern};
use super::quality::Quality;
use super::registrar::{Outlined, Registrar};
use super::starts::Disturbed;
use super::view::View;

/// Share of the outline that falls on itself.
const SHARE: f64 = 0.65;

/// Most shifts.
const MOST: usize = 12;

/// Cosine of the largest angle between directions that are alike.
const ALONG: f64 = 0.95;

/// Share of the contour, of that of the best theta, from which a shifted one is another answer.
const AS_GOOD: f64 = 0.97;

/// Find the shifts of an outline on the plane z = 1, most frequent ones first: differences of places with one direction vote in cells of two
/// spacings, and cells with many votes are counted place by place.
pub(super) fn periods(outline: &Outline, focal: f64) -> Vec<[f64; 2]> {
    let cell = 2.0 * outline.spacing;
    let places: Vec<[f64; 2]> = outline.places.iter().map(|p| p.map(|v| v * focal)).collect();
    let along: Vec<[f64; 2]> = outline.places.iter().zip(&outline.ahead).map(|(p, q)| unit(p, q)).collect();
    let alike = |i: usize, j: usize| along[i][0] * along[j][0] + along[i][1] * along[j][1] > ALONG;
    let mut votes: std::collections::BTreeMap<[i64; 2], usize> = std::collections::BTreeMap::new();
    for i in 0..places.len() {
        for j in (0..places.len()).filter(|j| alike(i, *j)) {
            let shift = [0, 1].map(|d| ((places[j][d] - places[i][d]) / cell).round() as i64);
            if shift[0].abs().max(shift[1].abs()) > 2 {
                *votes.entry(shift).or_default() += 1;
            }
        }
    }
    let mut cells: Vec<([i64; 2], usize)> = votes.into_iter().filter(|(_, n)| 4 * n > places.len()).collect();
    cells.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let mut found: Vec<([f64; 2], f64)> = Vec::new();
    for (shift, _) in cells.into_iter().take(20 * MOST) {
        let shift = shift.map(|v| v as f64 * cell);
        let on_itself = |i: &usize| {
            let near = |j: &usize| {
                let off = [0, 1].map(|d| places[*i][d] + shift[d] - places[*j][d]);
                off[0].abs().max(off[1].abs()) < cell && alike(*i, *j)
            };
            (0..places.len()).any(|j| near(&j))
        };
        let share = (0..places.len()).filter(on_itself).count() as f64 / places.len() as f64;
        match found.iter_mut().find(|(known, _)| (known[0] - shift[0]).hypot(known[1] - shift[1]) < 3.0 * cell) {
            Some(known) if share > known.1 => *known = (shift, share),
            None if share > SHARE => found.push((shift, share)),
            _ => {}
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.into_iter().take(MOST).map(|(shift, _)| shift.map(|v| v / focal)).collect()
}

fn unit(p: &[f64; 2], q: &[f64; 2]) -> [f64; 2] {
    let (x, y) = (q[0] - p[0], q[1] - p[1]);
    let size = x.hypot(y).max(1e-300);
    [x / size, y / size]
}

impl Registrar {
    /// Try the shifts under which the pattern repeats itself; return the theta with the most of the contour, and whether another one
    /// has nearly as much.
    pub(super) fn among_shifts(
        &self,
        outlined: &Outlined,
        pattern: &Pattern,
        view: &View,
        mut theta: Vec<f64>,
        mut quality: Quality,
    ) -> (Vec<f64>, Quality, bool) {
        let disturbed = Disturbed::new(self, pattern, 0);
        let seen = |quality: &Quality| quality.share * quality.visible;
        let mut tried = vec![theta.clone()];
        loop {
            let (mut better, mut as_good): (Option<(Vec<f64>, Quality)>, bool) = (None, false);
            for shift in &pattern.periods {
                let Some(start) = disturbed.shifted(&theta, *shift) else { continue };
                let fit = self.fit_outline(outlined, view, &start, Schedule::TILT);
                let Some(fit) = fit.filter(|fit| self.is_plausible(pattern, &fit.theta)) else { continue };
                if self.outlines_are_near(outlined, &fit.theta, &theta) {
                    continue;
                }
                let of_fit = self.quality_of(outlined, pattern, view, &fit.theta);
                as_good |= seen(&of_fit) > AS_GOOD * seen(&quality);
                if seen(&of_fit) > better.as_ref().map_or(seen(&quality), |(_, best)| seen(best)) {
                    better = Some((fit.theta, of_fit));
                }
            }
            match better {
                Some(found) if tried.len() < MOST => {
                    (theta, quality) = found;
                    tried.push(theta.clone());
                }
                _ => return (theta, quality, as_good),
            }
        }
    }

    /// Say whether two thetas map the outline to the same places, to half its spacing.
    fn outlines_are_near(&self, outlined: &Outlined, a: &[f64], b: &[f64]) -> bool {
        let (p, q) = (outlined.places.at(a, None), outlined.places.at(b, None));
        let size = q.x.iter().flatten().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
        let far = p.x.iter().zip(&q.x).map(|(p, q)| (p[0] - q[0]).hypot(p[1] - q[1])).fold(0.0, f64::max);
        far < 0.02 * (size.1 - size.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_squares_of_a_board_repeat_and_a_triangle_does_not() {
        let outline = |corners: Vec<Vec<[f64; 2]>>| {
            let (mut places, mut ahead) = (Vec::new(), Vec::new());
            for polygon in corners {
                for (k, a) in polygon.iter().enumerate() {
                    let b = polygon[(k + 1) % polygon.len()];
                    // Places 2.5 apart on a side of a square: far less than the distance between two shifts.
                    for share in (0..8).map(|k| (f64::from(k) + 0.5) / 8.0) {
                        places.push([0, 1].map(|d| a[d] + share * (b[d] - a[d])));
                        ahead.push([0, 1].map(|d| a[d] + (share + 0.01) * (b[d] - a[d])));
                    }
                }
            }
            let levels = vec![super::super::edges::Levels::COVERAGE; places.len()];
            Outline { places, ahead, levels, spacing: 2.5, deviation: 0.0 }
        };
        let square = |i: f64, j: f64| {
            [[0.0, 0.0], [0.0, 20.0], [20.0, 20.0], [20.0, 0.0]].map(|[x, y]| [x + 20.0 * i, y + 20.0 * j])
        };
        let board = (0..10).flat_map(|i| (0..8).map(move |j| (i, j))).filter(|(i, j)| (i + j) % 2 == 0);
        let board = board.map(|(i, j)| square(f64::from(i), f64::from(j)).to_vec()).collect();
        let found = periods(&outline(board), 1.0);
        assert!(found.iter().any(|s| (s[0].abs() - 20.0).abs() < 6.0 && (s[1].abs() - 20.0).abs() < 6.0), "{found:?}");
        assert!(found.iter().all(|s| s[0].hypot(s[1]) > 15.0), "{found:?}");
        assert!(periods(&outline(vec![vec![[0.0, 0.0], [20.0, 90.0], [100.0, 10.0]]]), 1.0).is_empty());
    }
}
