//! Networks that are written here, byte by byte, against what they are meant to say.

use super::*;

/// A field of a protocol buffer that holds bytes.
fn bytes(field: u8, content: impl AsRef<[u8]>) -> Vec<u8> {
    let content = content.as_ref();
    let mut out = vec![field << 3 | 2];
    let mut left = content.len();
    while left >= 128 {
        out.push((left % 128) as u8 | 128);
        left /= 128;
    }
    out.push(left as u8);
    out.extend(content);
    out
}

/// A field that holds a small number.
fn number(field: u8, value: u8) -> Vec<u8> {
    vec![field << 3, value]
}

/// A tensor in or out of a graph: sides of zero are left open.
fn value(name: &str, dimensions: &[u8]) -> Vec<u8> {
    let dimension = |(axis, n): (usize, &u8)| match n {
        0 => bytes(1, bytes(2, format!("side {axis}"))),
        n => bytes(1, number(1, *n)),
    };
    let shape: Vec<u8> = dimensions.iter().enumerate().flat_map(dimension).collect();
    let tensor = [number(1, 1), bytes(2, shape)].concat();
    [bytes(1, name), bytes(2, bytes(1, tensor))].concat()
}

/// A file of one step, with attributes and constant tensors as they are in the format.
fn file(step: &str, attributes: &[u8], constants: &[Vec<u8>], inputs: &[(&str, &[u8])]) -> Vec<u8> {
    let named = inputs.iter().map(|(name, _)| *name);
    let all: Vec<u8> = named
        .chain((!constants.is_empty()).then_some("weights"))
        .flat_map(|name| bytes(1, name))
        .collect();
    let node = [&all, &bytes(2, "clean")[..], &bytes(4, step), attributes].concat();
    let mut graph = [bytes(1, node), bytes(2, "denoiser")].concat();
    graph.extend(constants.iter().flat_map(|c| bytes(5, c)));
    graph.extend(inputs.iter().flat_map(|(name, shape)| bytes(11, value(name, shape))));
    graph.extend(bytes(12, value("clean", &[1, 3, 0, 0])));
    let operators = [bytes(1, ""), number(2, 13)].concat();
    [number(1, 8), bytes(7, graph), bytes(8, operators)].concat()
}

/// A convolution of 3 x 3 from so many planes to three, borders dark.
fn convolution(planes: usize) -> (Vec<u8>, Vec<f32>) {
    let weights: Vec<f32> = (0..3 * planes * 9)
        .map(|i| ((i * 7) % 11) as f32 / 11.0 - 0.4)
        .collect();
    let attribute = |name: &str, values: &[u8]| {
        let all: Vec<u8> = values.iter().flat_map(|v| number(8, *v)).collect();
        bytes(5, [bytes(1, name), all, vec![0xa0, 1, 7]].concat())
    };
    let attributes = [attribute("kernel_shape", &[3, 3]), attribute("pads", &[1; 4])].concat();
    let dimensions: Vec<u8> = [3, planes as u8, 3, 3].iter().flat_map(|n| number(1, *n)).collect();
    let raw: Vec<u8> = weights.iter().flat_map(|w| w.to_le_bytes()).collect();
    let constant = [dimensions, number(2, 1), bytes(8, "weights"), bytes(9, raw)].concat();
    let input = [1, planes as u8, 0, 0];
    (file("Conv", &attributes, &[constant], &[("noisy", &input)]), weights)
}

fn read(content: &[u8]) -> Result<OnnxNetwork> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.onnx");
    std::fs::write(&path, content).unwrap();
    OnnxNetwork::read(&path)
}

fn picture(rows: usize, columns: usize) -> [Array3<f32>; 2] {
    [5, 3].map(|k| {
        Array3::from_shape_fn((rows, columns, 3), |(y, x, c)| {
            ((y * k + x * 3 + c * 2) % 13) as f32 / 13.0
        })
    })
}

#[test]
fn a_convolution_of_picture_and_noise_is_what_it_is_by_hand() {
    /// Single precision of 36 terms.
    const SINGLE: f32 = 1e-5;
    let (content, weights) = convolution(4);
    let network = read(&content).unwrap();
    assert_eq!(network.form(), Form::FourPlanes);
    for (rows, columns) in [(64, 96), (96, 32)] {
        let [noisy, deviation] = picture(rows, columns);
        let clean = network.denoise(&noisy, &deviation).unwrap();
        let plane = |p: usize, y: usize, x: usize| match p {
            3 => (0..3).map(|c| deviation[[y, x, c]]).sum::<f32>() / 3.0,
            c => noisy[[y, x, c]],
        };
        for (y, x, c) in [(0, 0, 0), (17, 30, 1), (rows - 1, columns - 1, 2)] {
            let mut sum = 0.0;
            for (i, w) in weights[c * 36..][..36].iter().enumerate() {
                let (p, at) = (i / 9, [y + i % 9 / 3, x + i % 3]);
                if (1..=rows).contains(&at[0]) && (1..=columns).contains(&at[1]) {
                    sum += w * plane(p, at[0] - 1, at[1] - 1);
                }
            }
            assert!((clean[[y, x, c]] - sum).abs() < SINGLE, "{} {sum}", clean[[y, x, c]]);
        }
    }
}

#[test]
fn noise_is_told_as_the_network_asks_for_it() {
    let [noisy, deviation] = picture(64, 64);
    let mean = |y: usize, x: usize| (0..3).map(|c| deviation[[y, x, c]]).sum::<f32>() / 3.0;
    let rms = (deviation.iter().map(|v| v * v).sum::<f32>() / deviation.len() as f32).sqrt();
    let own: &[u8] = &[1, 3, 0, 0];
    let blind = read(&file("Identity", &[], &[], &[("noisy", own)])).unwrap();
    assert_eq!(blind.form(), Form::Blind);
    assert_eq!(blind.denoise(&noisy, &deviation).unwrap(), noisy);
    let second: [(&[u8], Form); 3] = [
        (&[1, 1, 0, 0], Form::Map),
        (&[1, 1, 1, 1], Form::Number(4)),
        (&[1], Form::Number(1)),
    ];
    for (shape, form) in second {
        let network = read(&file("Sub", &[], &[], &[("noisy", own), ("deviation", shape)])).unwrap();
        assert_eq!(network.form(), form);
        let clean = network.denoise(&noisy, &deviation).unwrap();
        let told = if form == Form::Map { mean(20, 41) } else { rms };
        // Single precision of sums of some thousand terms.
        assert!((clean[[20, 41, 1]] - (noisy[[20, 41, 1]] - told)).abs() < 1e-5);
    }
}

#[test]
fn what_is_no_network_of_pictures_is_refused_in_words() {
    let (good, _) = convolution(4);
    let words = |content: &[u8]| read(content).map(|n| n.form()).unwrap_err().to_string();
    assert!(words(b"not a network").contains("ONNX"));
    assert!(words(&[]).contains("inputs") || words(&[]).contains("ONNX"));
    for length in [good.len() / 3, good.len() / 2, good.len() - 5] {
        assert!(words(&good[..length]).contains("network.onnx"));
    }
    let (five, _) = convolution(5);
    assert!(
        words(&five).contains("1,5") && words(&five).contains("[1, 4, 64, 96]"),
        "{}",
        words(&five)
    );
    let fixed = file("Identity", &[], &[], &[("noisy", &[1, 3, 48, 48])]);
    assert!(words(&fixed).contains("48"));
    let third = [("a", &[1u8, 3, 0, 0][..]), ("b", &[1]), ("c", &[1])];
    assert!(words(&file("Sum", &[], &[], &third)).contains("3 inputs"));
}
