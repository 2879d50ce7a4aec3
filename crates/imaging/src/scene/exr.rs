//! Scenes from OpenEXR files: linear light, in half or single precision.

use std::io::Cursor;

use exr::compression::Compression;
use exr::meta::MetaData;
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, Vec2, read};
use ndarray::Array3;

use super::colours::{Colours, Primaries};

/// Most channels of a file: renderers write a few dozen.
const MOST_CHANNELS: usize = 128;

/// Red, green and blue of the first layer that has them, or its luminance; and their colours. `takes` is asked for rows and columns
/// before room is set aside for them. What is wrong comes back in words.
pub(super) fn light(
    bytes: &[u8],
    takes: impl Fn(usize, usize) -> Result<(), String>,
) -> Result<(Array3<f64>, Colours), String> {
    let wrong = |e: exr::error::Error| format!("it is no EXR file that can be read: {e}");
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(wrong)?;
    for header in &meta.headers {
        if header.deep {
            return Err("it has deep pixels: write it with one value a pixel".into());
        }
        // The decoder of these counts beyond its numbers where a file is damaged.
        if matches!(header.compression, Compression::B44 | Compression::B44A) {
            return Err("its compression is B44: write it with ZIP or PIZ".into());
        }
        if header.channels.list.len() > MOST_CHANNELS {
            return Err(format!(
                "it has more than {MOST_CHANNELS} channels: write it with R, G and B alone"
            ));
        }
        takes(header.layer_size.height(), header.layer_size.width())?;
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(wrong)?;
    let layer = &image.layer_data;
    let (columns, rows) = (layer.size.width(), layer.size.height());
    takes(rows, columns)?;
    let channels = &layer.channel_data.list;
    let named = |name: &str| channels.iter().find(|c| c.name.to_string().eq_ignore_ascii_case(name));
    let found = ["R", "G", "B"].map(named);
    let found = match (found, named("Y")) {
        ([Some(r), Some(g), Some(b)], _) => [r, g, b],
        (_, Some(grey)) => [grey; 3],
        _ => {
            let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
            return Err(format!(
                "its channels are {}, neither R, G and B nor Y",
                names.join(", ")
            ));
        }
    };
    if found
        .iter()
        .any(|c| c.sampling != Vec2(1, 1) || c.sample_data.len() != rows * columns)
    {
        return Err("its channels have fewer samples than pixels".into());
    }
    let value = |samples: &FlatSamples, at: usize| match samples {
        FlatSamples::F16(values) => f64::from(values[at].to_f32()),
        FlatSamples::F32(values) => f64::from(values[at]),
        FlatSamples::U32(values) => f64::from(values[at]),
    };
    let light = Array3::from_shape_fn((rows, columns, 3), |(y, x, c)| {
        value(&found[c].sample_data, y * columns + x)
    });
    let pair = |v: Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
    let primaries: Option<Primaries> = image
        .attributes
        .chromaticities
        .map(|c| [c.red, c.green, c.blue, c.white].map(pair));
    Ok((light, Colours::linear(primaries)))
}
