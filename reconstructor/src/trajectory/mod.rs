//! Section 4.5: smooth paths on the pitch.
