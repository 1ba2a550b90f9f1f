//! What a reader is willing to spend on a stream that anyone may have written.

/// Upper bounds that every reader checks *before* it allocates. All are strict: exceeding one is an error, never a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of `match.json`.
    pub manifest_bytes: usize,
    /// Bytes of one chunk.
    pub chunk_bytes: usize,
    /// Bytes of the JSON inside one chunk.
    pub chunk_json_bytes: usize,
    /// Bytes that everything in one chunk takes after decoding.
    pub decoded_bytes_per_chunk: usize,
    /// Chunks named by one manifest.
    pub chunks: usize,
    /// People named by one manifest.
    pub people: usize,
    /// Frames in one chunk.
    pub frames_per_chunk: usize,
    /// Bodies in one frame.
    pub bodies_per_frame: usize,
    /// Vertices of one body.
    pub vertices_per_body: usize,
    /// Triangles of one body.
    pub triangles_per_body: usize,
    /// Width and height of a texture, pixels.
    pub texture_side_px: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            manifest_bytes: 8 << 20,
            chunk_bytes: 64 << 20,
            chunk_json_bytes: 16 << 20,
            decoded_bytes_per_chunk: 128 << 20,
            chunks: 100_000,
            people: 1_000,
            frames_per_chunk: 300,
            bodies_per_frame: 100,
            vertices_per_body: 50_000,
            triangles_per_body: 100_000,
            texture_side_px: 8192,
        }
    }
}
