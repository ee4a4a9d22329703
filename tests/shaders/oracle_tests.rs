//! Programs whose results were found by hand.
