//! A small GDSII encoder for tests: every record by hand, so that anything can be written, right or wrong.

/// The bytes of a layout in the making.
#[derive(Clone, Default)]
pub struct Gds(pub Vec<u8>);

/// An 8-byte real of the format.
pub fn real8(value: f64) -> [u8; 8] {
    if value == 0.0 {
        return [0; 8];
    }
    let mut exponent = 64;
    let mut fraction = value.abs();
    while fraction >= 1.0 {
        fraction /= 16.0;
        exponent += 1;
    }
    while fraction < 1.0 / 16.0 {
        fraction *= 16.0;
        exponent -= 1;
    }
    let bits = (fraction * (1u64 << 56) as f64) as u64;
    (bits | (exponent as u64) << 56 | u64::from(value < 0.0) << 63).to_be_bytes()
}

impl Gds {
    /// HEADER to UNITS, database unit 1 nm.
    pub fn library() -> Self {
        Self::library_with_unit(1e-9)
    }

    /// HEADER to UNITS.
    pub fn library_with_unit(unit_m: f64) -> Self {
        let mut gds = Self::default();
        gds.int2(0x00, &[600])
            .int2(0x01, &[2026, 1, 1, 0, 0, 0, 2026, 1, 1, 0, 0, 0]);
        gds.ascii(0x02, "TEST");
        let units = [real8(unit_m / 1e-6), real8(unit_m)].concat();
        gds.record(0x03, 5, &units);
        gds
    }

    pub fn record(&mut self, kind: u8, data: u8, body: &[u8]) -> &mut Self {
        let length = (body.len() + 4) as u16;
        self.0.extend(length.to_be_bytes());
        self.0.extend([kind, data]);
        self.0.extend(body);
        self
    }

    pub fn int2(&mut self, kind: u8, values: &[i16]) -> &mut Self {
        let body: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
        self.record(kind, 2, &body)
    }

    pub fn int4(&mut self, kind: u8, values: &[i32]) -> &mut Self {
        let body: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
        self.record(kind, 3, &body)
    }

    pub fn ascii(&mut self, kind: u8, text: &str) -> &mut Self {
        let mut body = text.as_bytes().to_vec();
        if body.len() % 2 == 1 {
            body.push(0);
        }
        self.record(kind, 6, &body)
    }

    pub fn empty(&mut self, kind: u8) -> &mut Self {
        self.record(kind, 0, &[])
    }

    /// BGNSTR and STRNAME.
    pub fn cell(&mut self, name: &str) -> &mut Self {
        self.int2(0x05, &[2026, 1, 1, 0, 0, 0, 2026, 1, 1, 0, 0, 0]);
        self.ascii(0x06, name)
    }

    pub fn end_cell(&mut self) -> &mut Self {
        self.empty(0x07)
    }

    pub fn polygon(&mut self, layer: i16, points: &[(i32, i32)]) -> &mut Self {
        let xy: Vec<i32> = points.iter().flat_map(|&(x, y)| [x, y]).collect();
        self.empty(0x08).int2(0x0D, &[layer]).int2(0x0E, &[0]);
        self.int4(0x10, &xy).empty(0x11)
    }

    /// A counter-clockwise rectangle from its corners.
    pub fn rect(&mut self, layer: i16, x0: i32, y0: i32, x1: i32, y1: i32) -> &mut Self {
        self.polygon(layer, &[(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])
    }

    /// A square of even width about its centre.
    pub fn square(&mut self, layer: i16, x: i32, y: i32, width: i32) -> &mut Self {
        let half = width / 2;
        self.rect(layer, x - half, y - half, x + half, y + half)
    }

    pub fn sref(&mut self, name: &str, x: i32, y: i32) -> &mut Self {
        self.empty(0x0A).ascii(0x12, name).int4(0x10, &[x, y]).empty(0x11)
    }

    pub fn placed(&mut self, name: &str, x: i32, y: i32, mirror: bool, mag: f64, angle: f64) -> &mut Self {
        self.empty(0x0A).ascii(0x12, name);
        self.strans(mirror, mag, angle).int4(0x10, &[x, y]).empty(0x11)
    }

    pub fn strans(&mut self, mirror: bool, mag: f64, angle: f64) -> &mut Self {
        let bits: u16 = if mirror { 0x8000 } else { 0 };
        self.record(0x1A, 1, &bits.to_be_bytes());
        self.record(0x1B, 5, &real8(mag)).record(0x1C, 5, &real8(angle))
    }

    pub fn array(&mut self, name: &str, columns: i16, rows: i16, points: [i32; 6]) -> &mut Self {
        self.empty(0x0B).ascii(0x12, name).int2(0x13, &[columns, rows]);
        self.int4(0x10, &points).empty(0x11)
    }

    pub fn text(&mut self, layer: i16, string: &str, x: i32, y: i32) -> &mut Self {
        self.empty(0x0C).int2(0x0D, &[layer]).int2(0x16, &[0]);
        self.int4(0x10, &[x, y]).ascii(0x19, string).empty(0x11)
    }

    /// ENDLIB; the bytes.
    pub fn end(&mut self) -> Vec<u8> {
        self.empty(0x04);
        std::mem::take(&mut self.0)
    }
}

/// A small layout with every element and optional record of the format, references of every kind.
pub fn everything() -> Vec<u8> {
    let mut gds = Gds::library();
    gds.cell("W").square(1, 0, 0, 120).end_cell();
    gds.cell("PAIR")
        .sref("W", 175, 175)
        .placed("W", -175, 175, true, 1.0, 90.0)
        .end_cell();
    gds.cell("ODD");
    // Optional records, and LAYER behind XY.
    gds.empty(0x08).record(0x26, 1, &[0, 1]).int4(0x2F, &[7]);
    gds.int4(0x10, &[0, 0, 90, 0, 45, 90, 0, 0])
        .int2(0x0E, &[0])
        .int2(0x0D, &[1]);
    gds.int2(0x2B, &[1]).ascii(0x2C, "value").empty(0x11);
    // A square in two XY records.
    gds.empty(0x08).int2(0x0D, &[1]).int2(0x0E, &[0]);
    gds.int4(0x10, &[1000, 0, 1100, 0, 1100, 100])
        .int4(0x10, &[1000, 100, 1000, 0])
        .empty(0x11);
    gds.empty(0x2D).int2(0x0D, &[1]).int2(0x2E, &[0]);
    gds.int4(0x10, &[2000, 0, 2100, 0, 2100, 100, 2000, 100, 2000, 0])
        .empty(0x11);
    gds.empty(0x09)
        .int2(0x0D, &[1])
        .int2(0x0E, &[0])
        .int2(0x21, &[4])
        .int4(0x0F, &[100]);
    gds.int4(0x30, &[50])
        .int4(0x31, &[50])
        .int4(0x10, &[3000, 0, 3100, 0, 3100, 500])
        .empty(0x11);
    gds.empty(0x15)
        .int2(0x0D, &[5])
        .int2(0x2A, &[0])
        .int4(0x10, &[0, 0])
        .empty(0x11);
    gds.text(10, "label", 5, 6).end_cell();
    gds.cell("LENS");
    for k in 0..10 {
        for j in 0..10 {
            gds.square(1, 175 + 350 * k, 175 + 350 * j, 100 + 2 * (k + j));
        }
    }
    gds.end_cell();
    gds.cell("TOP");
    gds.sref("LENS", 0, 0)
        .sref("PAIR", -40_000, 0)
        .placed("LENS", 200_000, 0, true, 2.0, 270.0);
    gds.array("W", 5, 4, [100_000, 100_000, 101_750, 100_000, 100_000, 101_400]);
    gds.array("LENS", 2, 1, [0, 300_000, 140_000, 300_000, 0, 400_000]);
    gds.sref("ODD", 50_000, 0).end_cell();
    gds.end()
}
