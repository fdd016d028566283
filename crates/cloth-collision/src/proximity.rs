//! Pairs within a distance, with their closest points.
