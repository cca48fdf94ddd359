//! Commands of the program that publish nothing: their output, their files, their refusals.

mod bad_input;
mod certify;
mod check_cues;
mod contest;
mod design;
mod draw;
mod files;
mod first_scene;
mod fit;
mod ground;
mod hard_scenes;
#[path = "../harness/mod.rs"]
mod harness;
mod interrupted;
mod margin;
mod packages;
mod placement;
mod require;
mod sheets;
mod swept;
mod turn;
