//! Files of films: animated GIF and PNG, and MP4 by the program `ffmpeg`.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use png::{BlendOp, ColorType, DisposeOp};

use super::gif::{GifWriter, Region};
use seedbed_figure::Pixels;

/// Kinds of files with films.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// Animated GIF.
    Gif,
    /// Animated PNG, with exact colors.
    Png,
    /// MP4 with H.264, which the program `ffmpeg` makes.
    Mp4,
}

/// What is equal for all frames of a film.
#[derive(Clone, Copy, Debug)]
pub struct FilmLayout {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Number of frames.
    pub frames: u32,
    /// Number of frames per second.
    pub frames_per_second: u32,
}

/// Writes frames, one after the other.
pub enum FilmEncoder {
    /// To an animated GIF.
    Gif(GifWriter<BufWriter<File>>),
    /// To an animated PNG.
    Png(PngWriter),
    /// To `ffmpeg`.
    Mp4(Child),
}

/// Writes an animated PNG. Of each picture only the rectangle that changed is stored.
pub struct PngWriter {
    writer: png::Writer<BufWriter<File>>,
    latest: Option<Pixels>,
}

/// Why there is no `ffmpeg`, and what to do.
const NO_FFMPEG: &str = "MP4 needs the program `ffmpeg`, which was not found; install it, or write FILE.gif or FILE.png (animated)";

impl FilmFormat {
    /// The format that the extension of a file names.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()? {
            "gif" => Some(Self::Gif),
            "png" => Some(Self::Png),
            "mp4" => Some(Self::Mp4),
            _ => None,
        }
    }
}

impl FilmEncoder {
    /// Begins a film.
    ///
    /// # Errors
    /// The file cannot be written, or there is no `ffmpeg` for an MP4.
    pub fn begin(format: FilmFormat, file: File, layout: FilmLayout) -> io::Result<Self> {
        let [width, height] = layout.size;
        let rate = layout.frames_per_second;
        Ok(match format {
            FilmFormat::Gif => {
                let file = BufWriter::new(file);
                Self::Gif(GifWriter::new(file, width as u16, height as u16, rate)?)
            }
            FilmFormat::Png => Self::Png(PngWriter::begin(file, layout)?),
            FilmFormat::Mp4 => Self::Mp4(start_ffmpeg(file, layout)?),
        })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// The file cannot be written.
    ///
    /// # Panics
    /// Never: `ffmpeg` is started with a pipe for frames.
    pub fn add(&mut self, picture: Pixels) -> io::Result<()> {
        match self {
            Self::Gif(writer) => writer.add(picture),
            Self::Png(writer) => writer.add(picture),
            Self::Mp4(ffmpeg) => {
                let mut frames = ffmpeg.stdin.as_ref().expect("ffmpeg reads frames");
                // A broken pipe is explained by what ffmpeg says at its end.
                match frames.write_all(&picture.rgb) {
                    Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error),
                    _ => Ok(()),
                }
            }
        }
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The file cannot be written, or `ffmpeg` failed.
    pub fn finish(self) -> io::Result<()> {
        match self {
            Self::Gif(writer) => writer.finish(),
            Self::Png(writer) => writer.writer.finish().map_err(io::Error::other),
            Self::Mp4(ffmpeg) => finish_ffmpeg(ffmpeg),
        }
    }
}

impl PngWriter {
    fn begin(file: File, layout: FilmLayout) -> io::Result<Self> {
        let [width, height] = layout.size;
        let mut encoder = png::Encoder::new(BufWriter::new(file), width, height);
        encoder.set_color(ColorType::Rgb);
        let endless = 0;
        let settings = encoder
            .set_animated(layout.frames, endless)
            .and_then(|()| encoder.set_frame_delay(1, layout.frames_per_second as u16))
            .and_then(|()| encoder.set_blend_op(BlendOp::Source))
            .and_then(|()| encoder.set_dispose_op(DisposeOp::None));
        settings.map_err(io::Error::other)?;
        Ok(Self {
            writer: encoder.write_header().map_err(io::Error::other)?,
            latest: None,
        })
    }

    fn add(&mut self, picture: Pixels) -> io::Result<()> {
        let region = Region::of_change(self.latest.as_ref(), &picture);
        self.write(&picture, region).map_err(io::Error::other)?;
        self.latest = Some(picture);
        Ok(())
    }

    fn write(&mut self, picture: &Pixels, region: Region) -> Result<(), png::EncodingError> {
        let [left, top, width, height] = region.sides();
        if self.latest.is_some() {
            self.writer.reset_frame_position()?;
            self.writer.set_frame_dimension(width, height)?;
            self.writer.set_frame_position(left, top)?;
        }
        let mut rgb = Vec::with_capacity(3 * (width * height) as usize);
        for row in top..top + height {
            let first = 3 * (row * picture.width + left) as usize;
            rgb.extend_from_slice(&picture.rgb[first..first + 3 * width as usize]);
        }
        self.writer.write_image_data(&rgb)
    }
}

/// Starts `ffmpeg`, which reads frames and writes the file. Sides become even, as H.264 needs them.
fn start_ffmpeg(file: File, layout: FilmLayout) -> io::Result<Child> {
    let [width, height] = layout.size;
    let started = Command::new("ffmpeg")
        .args(["-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"])
        .args(["-s", &format!("{width}x{height}")])
        .args(["-r", &layout.frames_per_second.to_string(), "-i", "pipe:0"])
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white"])
        .args(["-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"])
        .args([
            "-movflags",
            "frag_keyframe+empty_moov",
            "-f",
            "mp4",
            "pipe:1",
        ])
        .stdin(Stdio::piped())
        .stdout(Stdio::from(file))
        .stderr(Stdio::piped())
        .spawn();
    started.map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => io::Error::other(NO_FFMPEG),
        _ => error,
    })
}

fn finish_ffmpeg(mut ffmpeg: Child) -> io::Result<()> {
    drop(ffmpeg.stdin.take());
    let mut said = String::new();
    if let Some(mut errors) = ffmpeg.stderr.take() {
        errors.read_to_string(&mut said)?;
    }
    if ffmpeg.wait()?.success() {
        return Ok(());
    }
    let last = said.lines().last().unwrap_or("no reason");
    Err(io::Error::other(format!("ffmpeg failed: {last}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(level: u8) -> Pixels {
        let mut rgb = vec![255; 3 * 12];
        rgb[3 * 5] = level;
        Pixels {
            width: 4,
            height: 3,
            rgb,
        }
    }

    /// Three pictures of 4 × 3 pixels, of which one pixel changes: the parts after the first have one pixel.
    #[test]
    fn an_animated_png_has_all_frames() {
        let file = tempfile::tempfile().unwrap();
        let layout = FilmLayout {
            size: [4, 3],
            frames: 3,
            frames_per_second: 10,
        };
        let reading = file.try_clone().unwrap();
        let mut encoder = FilmEncoder::begin(FilmFormat::Png, file, layout).unwrap();
        for level in [0, 100, 200] {
            encoder.add(picture(level)).unwrap();
        }
        encoder.finish().unwrap();
        let mut bytes = Vec::new();
        io::Seek::rewind(&mut &reading).unwrap();
        (&reading).read_to_end(&mut bytes).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
        let sizes = [0, 1, 2].map(|_| {
            let frame = reader.next_frame(&mut buffer).unwrap();
            (frame.width, frame.height, buffer[0])
        });
        assert_eq!(sizes, [(4, 3, 255), (1, 1, 100), (1, 1, 200)]);
    }
}
