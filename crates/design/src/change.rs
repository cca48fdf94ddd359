//! The changes of a text that a page asks for, in one place.
//!
//! In: a scene with its text, and a request. Out: another text, which may be no scene.

use crate::request::{Request, Wish};
use crate::scene::{DesignedScene, Fault};
use crate::{additions, cues, edit, geojson, handles};
use bench_dragon_motion::timeline::Timeline;

/// Returns the text that a request makes of a scene; `None` for a request that changes no text. `now` is the time that
/// the page shows, and `timeline` has the events, where they are known.
pub fn changed(
    scene: &DesignedScene,
    wish: &Wish,
    now: f64,
    timeline: Option<&Timeline>,
) -> Option<Result<String, Fault>> {
    Some(match wish {
        Wish::Set(values) => edit::set(scene, values),
        Wish::Drag(drag) => match cues::dragged(&drag.handle) {
            Some(cue) => cues::drag(scene, cue, drag, timeline),
            None => handles::drag(scene, drag),
        },
        Wish::Add(addition) => additions::add(scene, addition, now),
        Wish::Remove(name) => additions::remove(scene, name),
        Wish::GeoJson(text) => match geojson::polygons(text) {
            Ok(polygons) => additions::add_polygons(scene, polygons),
            Err(error) => Err(error.to_string().into()),
        },
        Wish::Text(_) | Wish::At(_) | Wish::Plan(..) | Wish::Cancel | Wish::Template(_) | Wish::File => return None,
    })
}

/// Reads a request as a page sends it, and returns the scene that it makes of another one.
///
/// # Errors
/// [`Fault`] for what is no request, and for one that the scene cannot have.
pub fn requested(scene: &DesignedScene, json: &str) -> Result<DesignedScene, Fault> {
    let (_, wish) = Request::read(json).map_err(|error| error.to_string())?;
    let text = match wish {
        Wish::Text(text) => text,
        wish => changed(scene, &wish, 0.0, None).ok_or_else(|| "the request changes no text".to_owned())??,
    };
    DesignedScene::read(&text, "scene")
}
