//! From the stage's axes to a receiver's. In: the axes that a user chose. Out: vectors and rotations in those axes.
//! Pure.

use std::str::FromStr;

use bench_dragon_messages::sentence::Expected;

/// The stage's axes in the order of a vector's components: x to the right, y into the depth, and up.
const NAMES: [&str; 3] = ["x", "y", "up"];

/// The stage's axes that are the receiver's first, second and third axis, each perhaps reversed.
///
/// The stage's own are right-handed, seen from above as on paper: x to the right, y away from the audience, up towards
/// the reader. The axes of PosiStageNet (x right, y up, z depth) are `x,up,y`, the default.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes([Axis; 3]);

#[derive(Debug, Clone, Copy, PartialEq)]
struct Axis {
    /// Its place in [`NAMES`].
    of_stage: usize,
    sign: f64,
}

impl Default for Axes {
    fn default() -> Self {
        Self([0, 2, 1].map(|of_stage| Axis { of_stage, sign: 1.0 }))
    }
}

impl Axes {
    /// Returns a vector of the stage (x, y, up) in the receiver's axes.
    pub fn vector(&self, of_stage: [f64; 3]) -> [f64; 3] {
        self.0.map(|axis| match axis.sign * of_stage[axis.of_stage] {
            // A desk would show the sign of a negative zero.
            0.0 => 0.0,
            value => value,
        })
    }

    /// Returns a vector of the receiver's axes in those of the stage (x, y, up): the inverse of [`Self::vector`].
    pub fn stage(&self, of_receiver: [f64; 3]) -> [f64; 3] {
        let mut of_stage = [0.0; 3];
        for (axis, part) in self.0.iter().zip(of_receiver) {
            of_stage[axis.of_stage] = axis.sign * part;
        }
        of_stage
    }

    /// Returns a turn by `heading` radians from x towards y as axis times angle, in the receiver's axes. In any axes, a
    /// positive turn about the first axis is from the second towards the third, so axes of the other handedness reverse
    /// the turn.
    pub fn rotation(&self, heading: f64) -> [f64; 3] {
        let sign = self.handedness();
        self.vector([0.0, 0.0, sign * heading])
    }

    /// Returns 1 for right-handed axes, as the stage's, and -1 for left-handed axes.
    fn handedness(&self) -> f64 {
        let [first, second, third] = self.0;
        let cyclic = (first.of_stage + 1) % 3 == second.of_stage;
        let signs = first.sign * second.sign * third.sign;
        if cyclic { signs } else { -signs }
    }
}

impl std::fmt::Display for Axes {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = self.0.map(|axis| format!("{}{}", if axis.sign < 0.0 { "-" } else { "" }, NAMES[axis.of_stage]));
        write!(formatter, "{}", names.join(","))
    }
}

impl FromStr for Axes {
    type Err = Expected;

    fn from_str(text: &str) -> Result<Self, Expected> {
        let refused = || Expected("x, y and up once each, any of them with a minus, such as x,up,y or -x,up,-y".into());
        let axis = |word: &str| {
            let (sign, name) = word.trim().strip_prefix('-').map_or((1.0, word.trim()), |name| (-1.0, name));
            let of_stage = NAMES.iter().position(|known| *known == name)?;
            Some(Axis { of_stage, sign })
        };
        let axes: Vec<_> = text.split(',').map(axis).collect::<Option<_>>().ok_or_else(refused)?;
        let axes = <[Axis; 3]>::try_from(axes).map_err(|_| refused())?;
        let each_once = (0..3).all(|of_stage| axes.iter().any(|axis| axis.of_stage == of_stage));
        if each_once { Ok(Self(axes)) } else { Err(refused()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rodrigues' formula in components, which is how a receiver turns a vector by an orientation.
    fn turned(vector: [f64; 3], orientation: [f64; 3]) -> [f64; 3] {
        let angle = orientation.iter().map(|part| part * part).sum::<f64>().sqrt();
        let k = orientation.map(|part| if angle > 0.0 { part / angle } else { 0.0 });
        let cross = [
            k[1] * vector[2] - k[2] * vector[1],
            k[2] * vector[0] - k[0] * vector[2],
            k[0] * vector[1] - k[1] * vector[0],
        ];
        let along: f64 = (0..3).map(|i| k[i] * vector[i]).sum();
        std::array::from_fn(|i| vector[i] * angle.cos() + cross[i] * angle.sin() + k[i] * along * (1.0 - angle.cos()))
    }

    fn all() -> Vec<Axes> {
        let orders = ["x,y,up", "x,up,y", "y,x,up", "y,up,x", "up,x,y", "up,y,x"];
        let signed = |order: &str, signs: u32| {
            let words = order.split(',').enumerate();
            let words = words.map(|(k, word)| if signs >> k & 1 == 1 { format!("-{word}") } else { word.to_owned() });
            words.collect::<Vec<_>>().join(",")
        };
        orders.iter().flat_map(|order| (0..8).map(|signs| signed(order, signs).parse().unwrap())).collect()
    }

    #[test]
    fn an_orientation_turns_what_points_along_x_to_where_the_bench_points() {
        assert_eq!(all().len(), 48);
        for axes in all() {
            for heading in [-3.0f64, -0.4, 0.0, 1.0, 2.5] {
                let shown = turned(axes.vector([1.0, 0.0, 0.0]), axes.rotation(heading));
                let bench = axes.vector([heading.cos(), heading.sin(), 0.0]);
                for (shown, bench) in shown.iter().zip(bench) {
                    assert!((shown - bench).abs() < 1e-12, "{axes} at {heading}: {shown} for {bench}");
                }
            }
        }
    }

    #[test]
    fn a_vector_comes_back_from_every_axes() {
        assert!(all().iter().all(|axes| axes.stage(axes.vector([1.0, 2.0, 3.0])) == [1.0, 2.0, 3.0]));
    }

    #[test]
    fn the_default_is_x_right_y_up_z_depth() {
        let axes = Axes::default();
        assert_eq!((axes, axes.to_string()), ("x,up,y".parse().unwrap(), "x,up,y".to_owned()));
        assert_eq!(axes.vector([1.0, 2.0, 3.0]), [1.0, 3.0, 2.0]);
        assert_eq!(axes.rotation(0.5), [0.0, -0.5, 0.0], "left-handed: clockwise from above is positive");
        assert!(axes.handedness() < 0.0 && Axes::from_str("x,y,up").unwrap().handedness() > 0.0);
        assert_eq!(Axes::from_str("-x, up,-y").unwrap().vector([1.0, 2.0, 0.0]), [-1.0, 0.0, -2.0]);
        assert!(Axes::from_str("x,-up,y").unwrap().vector([1.0, 2.0, 0.0])[1].is_sign_positive());
    }

    #[test]
    fn what_is_no_three_axes_is_refused() {
        for text in ["", "x", "x,y", "x,y,x", "x,y,z", "x,y,up,up", "--x,y,up", "x;y;up"] {
            assert!(Axes::from_str(text).unwrap_err().to_string().contains("once each"), "{text}");
        }
    }
}
