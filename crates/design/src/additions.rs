//! Tables that are added to a scene and removed from it: pieces, obstacles, corners, cues, dragons.
//!
//! In: a scene with its text, and a request. Out: another text.

use std::f64::consts::TAU;

use toml_edit::{DocumentMut, Item, Table, Value};

use crate::edit::document;
use crate::handles::arc_through;
use crate::request::Addition;
use crate::scene::{DesignedScene, Fault};
use crate::tables::{Path, table};
use bench_dragon_motion::model::description::PathDescription;
use bench_dragon_motion::model::{Point, Vector};
use bench_dragon_show::scene::{MOST_DRAGONS, MOST_OBSTACLES};

/// The length of a line, and the radius of an arc, that a page adds without a place, in metres.
const LINE: f64 = 5.0;
const RADIUS: f64 = 5.0;
/// The name of the dragon that had none.
const FIRST_NAME: &str = "gold";
/// Half the size of an obstacle that a page adds, in metres.
const HALF: f64 = 1.0;

/// Adds what a page asks for. `now` is the time that it shows.
///
/// # Errors
/// [`Fault`] for what the scene cannot have.
pub fn add(scene: &DesignedScene, addition: &Addition, now: f64) -> Result<String, Fault> {
    match addition.what.as_str() {
        "piece" => add_piece(scene, addition),
        "obstacle" => add_obstacle(scene, addition),
        "corner" => add_corner(scene, addition),
        "cue" => add_cue(scene, addition.time.unwrap_or(now)),
        "dragon" => add_dragon(scene, addition),
        other => Err(format!("{other:?} cannot be added, expected piece, obstacle, corner, cue or dragon").into()),
    }
}

/// Removes the table or the corner of a name.
///
/// # Errors
/// [`Fault`] for a name that the text does not have.
pub fn remove(scene: &DesignedScene, name: &str) -> Result<String, Fault> {
    let mut document = document(&scene.text)?;
    Path::of(name)?.remove(&mut document)?;
    Ok(document.to_string())
}

/// Adds the polygons of a GeoJSON text as obstacles.
///
/// # Errors
/// [`Fault`] for a text without polygons.
pub fn add_polygons(scene: &DesignedScene, polygons: Vec<(Option<String>, Vec<Point>)>) -> Result<String, Fault> {
    if polygons.len() > MOST_OBSTACLES {
        let sentence = format!("the file has {} polygons, expected at most {MOST_OBSTACLES}", polygons.len());
        return Err(sentence.into());
    }
    let mut document = document(&scene.text)?;
    let mut names = names(scene);
    for (name, corners) in polygons {
        let name = unused(&mut names, name.as_deref().unwrap_or("obstacle"));
        let corners = corners.into_iter().map(place).collect::<Value>();
        let obstacle = table([("name", name.into()), ("polygon", corners)]);
        Path::of("stage.obstacles")?.push(&mut document, obstacle)?;
    }
    Ok(document.to_string())
}

fn names(scene: &DesignedScene) -> Vec<String> {
    scene.scene.ensemble.ground().names()
}

/// Returns a name that nothing has yet, and notes it.
fn unused(names: &mut Vec<String>, name: &str) -> String {
    let numbered = (2..).map(|k| format!("{name} {k}"));
    let mut free = [name.to_owned()].into_iter().chain(numbered).filter(|name| !names.contains(name));
    // There is a number that no name has.
    let free = free.next().unwrap_or_default();
    names.push(free.clone());
    free
}

fn metres(metres: f64) -> Value {
    let rounded = (metres * 1e3).round() / 1e3;
    Value::from(rounded + 0.0)
}

fn place(place: Point) -> Value {
    Value::from_iter([metres(place.x), metres(place.y)])
}

fn add_piece(scene: &DesignedScene, addition: &Addition) -> Result<String, Fault> {
    let ensemble = &scene.scene.ensemble;
    let number = addition.to.as_deref().and_then(|name| name.strip_prefix("dragons[")?.strip_suffix(']')?.parse().ok());
    let number: usize = number.unwrap_or(0);
    let motion = &ensemble.dragons().get(number).ok_or_else(|| format!("there is no dragon {number}"))?.motion;
    if !matches!(motion.description(), PathDescription::Route { .. }) {
        return Err("only a route has pieces, expected path.kind \"pieces\"".to_owned().into());
    }
    let path = motion.bare_path();
    let last = path.param_at(path.length());
    let (end, along) = (path.point(last), path.tangent(last));
    let to = addition.at.map(|at| motion.placement().own_point(at.into()) - end);
    let left = Vector::new(-along.y, along.x);
    let is_right = to.is_some_and(|to| to.dot(&left) < 0.0);
    let side = Value::from(if is_right { "right" } else { "left" });
    let kind = addition.kind.as_deref().unwrap_or("line");
    let of_kind = ("kind", Value::from(kind));
    let piece = match kind {
        "line" => {
            let length = to.map_or(LINE, |to| to.dot(&along)).max(0.1);
            table([of_kind, ("length", metres(length))])
        }
        "arc" => {
            let towards = if is_right { -left } else { left };
            let (radius, angle) = to.map_or((RADIUS, 0.25 * TAU), |to| arc_through(end, along, towards, end + to));
            let turns = (angle / TAU * 1e4).round().max(1.0) / 1e4;
            table([of_kind, ("radius", metres(radius)), ("side", side), ("turns", turns.into())])
        }
        "spiral" => {
            let pitches = motion.description().pitches().collect::<Vec<_>>();
            let pitch = pitches.last().copied().unwrap_or(1.8);
            let radius = to.map_or(4.0 * pitch, |to| to.norm()).max(2.0 * pitch);
            table([
                of_kind,
                ("direction", "in".into()),
                ("side", side),
                ("pitch", metres(pitch)),
                ("radius", metres(radius)),
                ("to_radius", metres(0.5 * radius)),
            ])
        }
        "turn" => table([of_kind]),
        other => return Err(format!("{other:?} is no kind of a piece, expected line, arc, spiral or turn").into()),
    };
    let mut document = document(&scene.text)?;
    Path::of(&format!("{}path.pieces", scene.prefix(number)))?.push(&mut document, piece)?;
    Ok(document.to_string())
}

fn add_obstacle(scene: &DesignedScene, addition: &Addition) -> Result<String, Fault> {
    let at = Point::from(addition.at.unwrap_or([0.0, 0.0]));
    let name = unused(&mut names(scene), "obstacle");
    let corners =
        |signs: &[[f64; 2]]| signs.iter().map(|[x, y]| place(at + HALF * Vector::new(*x, *y))).collect::<Value>();
    let shape = match addition.kind.as_deref().unwrap_or("circle") {
        "circle" => {
            let circle = table([("center", place(at)), ("radius", metres(HALF))]);
            ("circle", circle.into_inline_table().into())
        }
        "polygon" => ("polygon", corners(&[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])),
        "line" => ("line", corners(&[[-2.0, 0.0], [2.0, 0.0]])),
        other => return Err(format!("{other:?} is no kind of an obstacle, expected circle, polygon or line").into()),
    };
    let mut document = document(&scene.text)?;
    Path::of("stage.obstacles")?.push(&mut document, table([("name", name.into()), shape]))?;
    Ok(document.to_string())
}

fn add_corner(scene: &DesignedScene, addition: &Addition) -> Result<String, Fault> {
    let (Some(after), Some(at)) = (&addition.after, addition.at) else {
        return Err("a corner is added after another one, at a place: expected after and at".to_owned().into());
    };
    let mut document = document(&scene.text)?;
    Path::of(after)?.insert_after(&mut document, place(at.into()))?;
    Ok(document.to_string())
}

fn add_cue(scene: &DesignedScene, time: f64) -> Result<String, Fault> {
    let mut names = scene.scene.cues.iter().map(|cue| cue.name.clone()).collect();
    let cue = table([("name", unused(&mut names, "cue").into()), ("at", metres(time))]);
    let mut document = document(&scene.text)?;
    Path::of("cues")?.push(&mut document, cue)?;
    Ok(document.to_string())
}

/// Adds a dragon like the last one, at another place.
fn add_dragon(scene: &DesignedScene, addition: &Addition) -> Result<String, Fault> {
    let dragons = scene.scene.ensemble.dragons();
    if dragons.len() >= MOST_DRAGONS {
        return Err(format!("the scene has {MOST_DRAGONS} dragons already, and no more are possible").into());
    }
    let mut document = document(&scene.text)?;
    if scene.scene.ensemble.only().is_some() {
        name_the_dragon(&mut document)?;
    }
    let list = Path::of("dragons")?;
    let mut dragon = list.last_table(&mut document).ok_or_else(|| "the dragons are no [[dragons]]".to_owned())?;
    let names: Vec<&str> = dragons.iter().map(|dragon| &*dragon.name).collect();
    let free = (2..).map(|k| format!("dragon_{k}")).find(|name| !names.contains(&name.as_str()));
    dragon.insert("name", toml_edit::value(free.unwrap_or_default()));
    list.push(&mut document, dragon)?;
    let at = addition.at.map_or_else(|| Point::new(0.0, 5.0 * dragons.len() as f64), Point::from);
    let origin = format!("dragons[{}].placement.origin", dragons.len());
    Path::of(&origin)?.insert(&mut document, place(at))?;
    Ok(document.to_string())
}

/// Makes the dragon of `[team]` the first of `[[dragons]]`. The show keeps the rest of `[motion]`.
fn name_the_dragon(document: &mut DocumentMut) -> Result<(), Fault> {
    let root = document.as_table_mut();
    let mut dragon = table([("name", FIRST_NAME.into())]);
    dragon.set_position(root.get("team").and_then(|team| team.as_table()?.position()));
    for key in ["team", "path", "placement"] {
        if let Some((key, item)) = root.remove_entry(key) {
            dragon.insert_formatted(&key, item);
        }
    }
    let of_show = root.get_mut("motion").and_then(|motion| motion.as_table_mut());
    let of_show = of_show.ok_or_else(|| "the text has no table [motion]".to_owned())?;
    let mut own = Table::new();
    for key in ["head_speed", "accuracy", "solver", "paper"] {
        if let Some((key, item)) = of_show.remove_entry(key) {
            own.insert_formatted(&key, item);
        }
    }
    dragon.insert("motion", Item::Table(own));
    Path::of("dragons")?.push(document, dragon)
}
