//! The design of a scene: its text is the truth, and a picture shows it.
//!
//! In: the text of a scene, and requests of a page. Out: the fields and handles of the scene, changed texts, frames,
//! events and clearances. `text` finds every value in the text, `scene` has the fields, `handles` the places that can
//! be dragged, and `change` the changes of the text. `session` answers a page; nothing here opens a socket or a file.

mod additions;
pub mod change;
mod cues;
mod edit;
mod frame;
mod geojson;
pub mod handles;
mod plan;
pub mod request;
pub mod scene;
mod search;
pub mod session;
mod tables;
pub mod templates;
#[cfg(test)]
mod tests;
mod text;
