//! The places of a scene that can be dragged, each with the numbers that put it elsewhere.
//!
//! In: a scene with its text. Out: its [`Handle`]s; and for a dragged one the changes of the text. A handle and its
//! inversion stand beside each other: `paths` has those of spirals, turnarounds and whole paths, `pieces` those of
//! routes, `ground` those of obstacles and the boundary. All places are on the stage.

mod ground;
mod paths;
mod pieces;

pub(crate) use pieces::arc_through;
use serde::Serialize;

use crate::edit::{self, Change};
use crate::request::Drag;
use crate::scene::{DesignedScene, Fault};
use bench_dragon_motion::model::{Point, Vector};

/// The distance to whose multiples a dragged place snaps, in metres.
const SNAP: f64 = 0.1;
/// The greatest distance of a handle from its place that rounding its numbers may leave, in metres.
const ROUNDING: f64 = 1e-3;

/// A place of the stage that can be dragged.
#[derive(Serialize)]
pub struct Handle {
    /// Its name: that of a number, of a piece's end or middle, of a corner.
    pub name: String,
    /// The kind: `end`, `middle`, `pitch`, `turns`, `radius`, `heading`, `placement`, `centre`, `corner`, `rim`,
    /// `keep_out` or `boundary`.
    pub kind: &'static str,
    /// The coordinate to the right, in metres.
    pub x: f64,
    /// The coordinate up, in metres.
    pub y: f64,
    /// The line of the text, from 1.
    pub line: usize,
    /// The names of the numbers that it changes.
    pub fields: Vec<String>,
    #[serde(skip)]
    changes: Box<Changes>,
}

/// The changes of the text for a pull.
type Changes = dyn Fn(&Pull) -> Vec<Change>;

/// The place to which a handle is pulled.
#[derive(Debug, Clone, Copy)]
struct Pull {
    to: Point,
    free: bool,
    /// True if an arc may change its side.
    alt: bool,
}

/// A half-line on the stage.
#[derive(Debug, Clone, Copy)]
struct Ray {
    origin: Point,
    /// Of length 1.
    direction: Vector,
}

/// The straight track of a handle.
#[derive(Debug, Clone, Copy)]
struct Track {
    ray: Ray,
    /// The distance of the handle along the ray, in metres.
    at: f64,
    /// The change of the handle's number for a metre of the handle.
    step: f64,
}

impl Pull {
    /// Returns the place, on the grid unless it is free.
    fn place(&self) -> Point {
        self.to.map(|metres| self.snapped(metres))
    }

    /// Returns the distance along a ray, on the grid unless it is free.
    fn along(&self, ray: &Ray) -> f64 {
        self.snapped((self.to - ray.origin).dot(&ray.direction))
    }

    fn snapped(&self, metres: f64) -> f64 {
        // A product with 0.1 would leave the last digit.
        if self.free { metres } else { (metres / SNAP).round() / SNAP.recip() }
    }
}

impl Ray {
    fn towards(origin: Point, other: Point) -> Self {
        let by = other - origin;
        let direction = if by.norm() > 0.0 { by.normalize() } else { Vector::x() };
        Self { origin, direction }
    }

    fn at(&self, metres: f64) -> Point {
        self.origin + metres * self.direction
    }
}

/// The handles of a scene while they are found.
struct Found<'s> {
    scene: &'s DesignedScene,
    handles: Vec<Handle>,
}

impl Found<'_> {
    /// Adds a handle; `fields` are the numbers that it changes.
    fn add(
        &mut self,
        name: String,
        kind: &'static str,
        place: Point,
        fields: Vec<String>,
        changes: impl Fn(&Pull) -> Vec<Change> + 'static,
    ) {
        let line = fields.iter().chain([&name]).find_map(|name| self.scene.line_of(name));
        let line = line.or_else(|| self.scene.line_of(name.rsplit_once('.')?.0)).unwrap_or(1);
        let (x, y) = (place.x, place.y);
        self.handles.push(Handle { name, kind, x, y, line, fields, changes: Box::new(changes) });
    }

    /// Adds a handle on a straight track, whose distance along it gives the number of the field `field`.
    fn add_on_track(
        &mut self,
        name: String,
        kind: &'static str,
        field: String,
        track: Track,
        number: impl Fn(f64) -> f64 + 'static,
    ) {
        let of = field.clone();
        let Track { ray, at, step } = track;
        self.add(name, kind, ray.at(at), vec![field], move |pull| {
            vec![Change::number(&of, number(pull.along(&ray)), ROUNDING * step)]
        });
    }

    /// Adds a handle that is a place of the text.
    fn add_place(&mut self, name: String, kind: &'static str, place: Point) {
        let fields = vec![format!("{name}[0]"), format!("{name}[1]")];
        let of = name.clone();
        self.add(name, kind, place, fields, move |pull| vec![Change::place(&of, pull.place())]);
    }
}

/// Returns the handles of a scene.
pub fn handles(scene: &DesignedScene) -> Vec<Handle> {
    let mut found = Found { scene, handles: Vec::new() };
    for (number, dragon) in scene.scene.ensemble.dragons().iter().enumerate() {
        paths::add(&mut found, &scene.prefix(number), &dragon.motion);
        pieces::add(&mut found, &scene.prefix(number), &dragon.motion);
    }
    ground::add(&mut found, scene.scene.ensemble.ground());
    found.handles
}

/// Drags a handle. Returns the changed text.
///
/// # Errors
/// [`Fault`] for a handle that the scene does not have, and a place without numbers.
pub fn drag(scene: &DesignedScene, drag: &Drag) -> Result<String, Fault> {
    let Drag { handle: ref name, to, free, alt } = *drag;
    let handles = handles(scene);
    let handle = handles.iter().find(|handle| handle.name == *name);
    let handle = handle.ok_or_else(|| format!("the scene has no handle {name}"))?;
    edit::apply(scene, &(handle.changes)(&Pull { to: to.into(), free, alt }))
}
