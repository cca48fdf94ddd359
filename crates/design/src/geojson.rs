//! The polygons of a GeoJSON text (RFC 7946).
//!
//! In: a text, in metres of the stage or in degrees of longitude and latitude. Out: polygons with their names, in
//! metres of the stage. Degrees are mapped to metres about the middle of all polygons, which comes to the origin.

use serde_json::Value;

use bench_dragon_motion::model::Point;

/// The radius of the earth, in metres.
const EARTH: f64 = 6_371_008.8;
/// The extent below which coordinates are degrees: a square of a village has some thousandths of a degree, and no
/// polygon of a stage is so small in metres.
const MOST_DEGREES: f64 = 0.1;

/// A polygon and its name.
pub type Named = (Option<String>, Vec<Point>);

/// A text without polygons.
#[derive(Debug, thiserror::Error)]
pub enum GeoJsonError {
    /// The text is no JSON.
    #[error("{0}: expected a GeoJSON file with polygons")]
    Json(#[from] serde_json::Error),
    /// The JSON has no polygon.
    #[error("the file has no polygon, expected a GeoJSON file with polygons")]
    NoPolygon,
}

/// Returns the polygons of a text.
///
/// # Errors
/// [`GeoJsonError`]
pub fn polygons(text: &str) -> Result<Vec<Named>, GeoJsonError> {
    let root: Value = serde_json::from_str(text)?;
    let mut found = Vec::new();
    add(&root, None, &mut found);
    if found.is_empty() {
        return Err(GeoJsonError::NoPolygon);
    }
    let places = || found.iter().flat_map(|(_, corners)| corners);
    let least = places().copied().reduce(|one, other| one.inf(&other)).unwrap_or_default();
    let most = places().copied().reduce(|one, other| one.sup(&other)).unwrap_or_default();
    if (most - least).amax() < MOST_DEGREES {
        let middle = least + 0.5 * (most - least);
        let scale = EARTH.to_radians();
        for corner in found.iter_mut().flat_map(|(_, corners)| corners) {
            let by = *corner - middle;
            *corner = Point::new(scale * middle.y.to_radians().cos() * by.x, scale * by.y);
        }
    }
    Ok(found)
}

/// Adds the polygons of an object.
fn add(object: &Value, name: Option<&str>, found: &mut Vec<Named>) {
    let list = |key: &str| object[key].as_array().into_iter().flatten();
    match object["type"].as_str() {
        Some("FeatureCollection") => list("features").for_each(|feature| add(feature, None, found)),
        Some("Feature") => add(&object["geometry"], object["properties"]["name"].as_str(), found),
        Some("GeometryCollection") => list("geometries").for_each(|geometry| add(geometry, name, found)),
        Some("Polygon") => found.extend(polygon(&object["coordinates"], name)),
        Some("MultiPolygon") => found.extend(list("coordinates").filter_map(|rings| polygon(rings, name))),
        _ => {}
    }
}

/// Returns the outer ring of a polygon without its last corner, which repeats the first.
fn polygon(rings: &Value, name: Option<&str>) -> Option<Named> {
    let corner = |place: &Value| Some(Point::new(place.get(0)?.as_f64()?, place.get(1)?.as_f64()?));
    let mut corners: Vec<Point> = rings.get(0)?.as_array()?.iter().filter_map(corner).collect();
    if corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    (corners.len() >= 3).then(|| (name.map(str::to_owned), corners))
}
