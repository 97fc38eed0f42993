//! Distortion by a lens: where a point of the plane z = 1 is seen, and back.

/// How a lens moves points of the plane z = 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lens {
    /// It does not.
    None,
    /// Radial, tangential and thin-prism terms: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4.
    ///
    /// With r^2 = x^2 + y^2: x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
    /// plus s1 r^2 + s2 r^4, and y' likewise with p1 (r^2 + 2 y^2) + 2 p2 x y + s3 r^2 + s4 r^4. The camera model of OpenCV; ROS names
    /// it `plumb_bob` and `rational_polynomial`, Kalibr `radtan`.
    Polynomial([f64; 12]),
    /// The angle t to the optical axis is seen at the distance t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8) (Kannala and Brandt 2006;
    /// OpenCV's fisheye model, `equidistant` of ROS and Kalibr).
    Equidistant([f64; 4]),
}

/// Steps of Newton's method.
const NEWTON: usize = 30;

/// Steps from the centre to a point where Newton's method alone does not arrive.
const STAGES: usize = 32;

/// Places between the centre and a solution where the map must not be folded.
const PROBES: usize = 8;

impl Lens {
    /// Make a lens of OpenCV's coefficients in OpenCV's order, 4, 5, 8, 12 or 14 of them (no tilt: the last two are 0); `None` for
    /// other counts and numbers that are not finite.
    pub fn polynomial(coefficients: &[f64]) -> Option<Self> {
        if ![4, 5, 8, 12, 14].contains(&coefficients.len()) || coefficients.iter().any(|k| !k.is_finite()) {
            return None;
        }
        if coefficients.iter().skip(12).any(|tilt| *tilt != 0.0) {
            return None;
        }
        let mut all = [0.0; 12];
        let count = coefficients.len().min(12);
        all[..count].copy_from_slice(&coefficients[..count]);
        Some(if all == [0.0; 12] { Lens::None } else { Lens::Polynomial(all) })
    }

    /// Make a fisheye lens of its four coefficients; `None` for numbers that are not finite.
    pub fn equidistant(coefficients: [f64; 4]) -> Option<Self> {
        coefficients.iter().all(|k| k.is_finite()).then_some(Lens::Equidistant(coefficients))
    }

    /// Return where a point of the plane z = 1 is seen.
    pub fn distort(self, point: [f64; 2]) -> [f64; 2] {
        match self {
            Lens::None => point,
            Lens::Polynomial(_) => self.bend(point),
            Lens::Equidistant(_) => {
                let radius = point[0].hypot(point[1]);
                let angle = radius.atan();
                self.bend(if radius > 0.0 { point.map(|x| x * angle / radius) } else { point })
            }
        }
    }

    /// Return the point of the plane z = 1 that is seen here; `None` where none in front of the camera is, or the lens is folded.
    pub fn undistort(self, seen: [f64; 2]) -> Option<[f64; 2]> {
        if self == Lens::None {
            return Some(seen);
        }
        let bent = self.unbend(seen)?;
        if let Lens::Polynomial(_) = self {
            return Some(bent);
        }
        let angle = bent[0].hypot(bent[1]);
        let ahead = angle < std::f64::consts::FRAC_PI_2;
        ahead.then(|| if angle > 0.0 { bent.map(|x| x * angle.tan() / angle) } else { bent })
    }

    /// The smooth part of the map, from the plane z = 1 (polynomial) or from angles (equidistant).
    fn bend(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r2 = x * x + y * y;
        let polynomial = |k: &[f64]| k.iter().rev().fold(0.0, |sum, k| (sum + k) * r2) + 1.0;
        match self {
            Lens::None => [x, y],
            Lens::Equidistant(k) => [x, y].map(|v| v * polynomial(&k)),
            Lens::Polynomial([k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4]) => {
                let radial = polynomial(&[k1, k2, k3]) / polynomial(&[k4, k5, k6]);
                let prism = |a: f64, b: f64| r2 * (a + b * r2);
                [
                    x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + prism(s1, s2),
                    y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + prism(s3, s4),
                ]
            }
        }
    }

    /// Invert [`Lens::bend`] on the part that hangs together with the centre: Newton's method from the point itself, and where that
    /// fails or crosses a fold, in small steps from the centre.
    fn unbend(self, seen: [f64; 2]) -> Option<[f64; 2]> {
        if !seen.iter().all(|v| v.is_finite()) {
            return None;
        }
        if let Some(found) = self.newton(seen, seen)
            && self.is_unfolded(found)
        {
            return Some(found);
        }
        let mut point = [0.0; 2];
        for stage in 1..=STAGES {
            let share = stage as f64 / STAGES as f64;
            point = self.newton(point, seen.map(|v| v * share))?;
        }
        self.is_unfolded(point).then_some(point)
    }

    fn newton(self, begin: [f64; 2], seen: [f64; 2]) -> Option<[f64; 2]> {
        let size = 1.0 + seen[0].hypot(seen[1]);
        let miss = |point: [f64; 2]| {
            let bent = self.bend(point);
            [bent[0] - seen[0], bent[1] - seen[1]]
        };
        let mut point = begin;
        for _ in 0..NEWTON {
            let [a, b] = miss(point);
            let [[xx, xy], [yx, yy]] = self.slope(point);
            let determinant = xx * yy - xy * yx;
            let step = [(yy * a - xy * b) / determinant, (xx * b - yx * a) / determinant];
            point = [point[0] - step[0], point[1] - step[1]];
            if !(step[0].is_finite() && step[1].is_finite()) {
                return None;
            }
            if step[0].hypot(step[1]) <= 1e-15 * size {
                break;
            }
        }
        let [a, b] = miss(point);
        (a.hypot(b) <= 1e-12 * size).then_some(point)
    }

    /// Return the derivatives of [`Lens::bend`] by differences: they only steer Newton's method.
    fn slope(self, point: [f64; 2]) -> [[f64; 2]; 2] {
        let h = 1e-6 * (1.0 + point[0].hypot(point[1]));
        let along = |dx: f64, dy: f64| {
            let (plus, minus) = (self.bend([point[0] + dx, point[1] + dy]), self.bend([point[0] - dx, point[1] - dy]));
            [(plus[0] - minus[0]) / (2.0 * h), (plus[1] - minus[1]) / (2.0 * h)]
        };
        let (x, y) = (along(h, 0.0), along(0.0, h));
        [[x[0], y[0]], [x[1], y[1]]]
    }

    /// Say whether the map keeps its orientation all the way from the centre.
    fn is_unfolded(self, point: [f64; 2]) -> bool {
        (1..=PROBES).all(|k| {
            let [[xx, xy], [yx, yy]] = self.slope(point.map(|v| v * k as f64 / PROBES as f64));
            xx * yy - xy * yx > 0.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn undistorted_points_are_seen_where_they_were() {
        let lenses = [
            Lens::polynomial(&[-0.28, 0.07, 0.000_2, 0.000_02]).unwrap(),
            Lens::polynomial(&[-0.37, 0.2, 0.001, -0.002, -0.05]).unwrap(),
            Lens::polynomial(&[0.9, 0.1, 0.001, -0.002, 0.02, 1.2, 0.3, 0.05, 1e-3, -2e-3, 1e-3, 5e-4]).unwrap(),
            Lens::equidistant([-0.01, 0.02, -0.015, 0.003]).unwrap(),
        ];
        for lens in lenses {
            for k in 0..400 {
                let (angle, radius) = (f64::from(k) * 0.37, f64::from(k) / 400.0 * 0.8);
                let point = [radius * angle.cos(), radius * angle.sin()];
                let back = lens.undistort(lens.distort(point)).unwrap();
                let miss = (back[0] - point[0]).hypot(back[1] - point[1]);
                assert!(miss < 1e-12, "{lens:?} {point:?}: {miss:e}");
            }
        }
        // A wide angle of a fisheye: 80 degrees.
        let lens = Lens::equidistant([0.02, -0.01, 0.003, 0.0]).unwrap();
        let point = [80.0_f64.to_radians().tan(), 0.0];
        assert!((lens.undistort(lens.distort(point)).unwrap()[0] - point[0]).abs() < 1e-9);
    }

    #[test]
    fn what_the_lens_cannot_show_is_none() {
        // r - 0.3 r^3 is largest at r = 1.054: 0.703.
        let lens = Lens::polynomial(&[-0.3, 0.0, 0.0, 0.0]).unwrap();
        assert!(lens.undistort([0.70, 0.0]).is_some_and(|p| p[0] < 1.06));
        assert_eq!(lens.undistort([0.71, 0.0]), None);
        assert_eq!(lens.undistort([-1.5, 1.5]), None);
        assert_eq!(lens.undistort([f64::NAN, 0.0]), None);
        // Behind the camera: more than 90 degrees off the axis.
        assert_eq!(Lens::equidistant([0.0; 4]).unwrap().undistort([1.6, 0.0]), None);
        assert_eq!(Lens::polynomial(&[1.0; 6]), None);
        assert_eq!(Lens::polynomial(&[0.0; 14]), Some(Lens::None));
        assert_eq!(Lens::polynomial(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.01, 0.0]), None);
    }
}
