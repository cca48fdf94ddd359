//! The safe solver: exact motion along the arc, each follower found by a bracketed Newton iteration.
