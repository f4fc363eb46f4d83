//! Samples, commands between them.
