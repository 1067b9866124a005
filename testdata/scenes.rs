//! The project's own stereo scenes, as worlds for the ray caster in `caster.rs`.
//!
//! These files are not part of the library: tests and the example `render-scenes` include them by `#[path]`.

#![allow(dead_code, unreachable_pub, reason = "each target that includes this module uses a part of it")]
#![allow(clippy::unreadable_literal, reason = "colours are 0xRRGGBB")]

mod caster;

use caster::{Pattern, Sensor, UP, VIEWER, Vec3, add, paint, scale, unit};
pub use caster::{Scene, World};

/// A scene and its size in `testdata/`.
#[derive(Clone, Copy, Debug)]
pub struct Recipe {
    /// Name of the scene.
    pub name: &'static str,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Number of labels.
    pub labels: u32,
    world: fn() -> World,
}

/// All scenes, as in `testdata/`.
pub const ALL: [Recipe; 16] = [
    Recipe::small("slanted", slanted),
    Recipe::small("thin", thin),
    Recipe::small("wall", wall),
    Recipe::small("repetitive", repetitive),
    Recipe::small("exposure", exposure),
    Recipe::small("light", light),
    Recipe::small("steep", steep),
    Recipe::small("rows", rows),
    Recipe::small("focus", focus),
    Recipe::small("grain", grain),
    Recipe::small("poster", poster),
    Recipe::small("screen", screen),
    Recipe::small("border", border),
    Recipe::small("corridor", corridor),
    Recipe::small("behind", behind),
    Recipe { name: "mixed", width: 320, height: 240, labels: 48, world: mixed },
];

impl Recipe {
    const fn small(name: &'static str, world: fn() -> World) -> Self {
        Self { name, width: 240, height: 180, labels: 32, world }
    }

    /// Renders the scene.
    pub fn render(&self) -> Scene {
        (self.world)().shoot(self.name, self.width, self.height, self.labels)
    }
}

/// Renders scene `name` at any size and with any number of labels. Textures get finer with the pixels.
///
/// # Panics
/// If there is no scene of that name, or as for [`World::shoot`].
pub fn render(name: &str, width: usize, height: usize, labels: u32) -> Scene {
    Recipe { width, height, labels, ..*recipe(name) }.render()
}

/// The bodies of scene `name`.
///
/// # Panics
/// If there is no scene of that name.
pub fn world(name: &str) -> World {
    (recipe(name).world)()
}

fn recipe(name: &str) -> &'static Recipe {
    let recipe = ALL.iter().find(|recipe| recipe.name == name);
    recipe.unwrap_or_else(|| panic!("there is no scene {name:?}"))
}

/// The scene `slanted` with a ball and a card passing in front, `step` frames after the first. Where nothing moves, frames differ only by
/// sensor noise.
///
/// # Panics
/// As for [`render`].
pub fn passing(step: u32, width: usize, height: usize, labels: u32) -> Scene {
    use Pattern::{Blotches, Checker};
    let mut world = World::new(11);
    slants(&mut world);
    let way = 0.02 * f64::from(step);
    world.ball([-0.75 + way, 0.28, 1.35], 0.15, [0.5, -1.0, 0.2], paint(Blotches(0.1), [0x5d7f4c, 0xd5cf8f]));
    let checker = paint(Checker(0.06), [0x46637e, 0xefe2c4]);
    world.card([0.6 - 0.5 * way, -0.05, 1.6], [0.3, 0.1, -1.0], UP, [0.16, 0.12], checker);
    world.sensors = [2 * step + 1000, 2 * step + 1001].map(Sensor::new);
    world.shoot("passing", width, height, labels)
}

/// The scene `slanted` from a rig that has moved right and forward, `step` frames after the first, so that everything in the views moves.
///
/// # Panics
/// As for [`render`].
pub fn moving(step: u32, width: usize, height: usize, labels: u32) -> Scene {
    let mut world = World::new(11);
    slants(&mut world);
    let way = f64::from(step);
    world.rig = [0.01 * way, 0.0, 0.004 * way];
    world.sensors = [2 * step + 1000, 2 * step + 1001].map(Sensor::new);
    world.shoot("moving", width, height, labels)
}

/// Planes at many slants, a ball and a tube; nothing is parallel to the image.
fn slanted() -> World {
    let mut world = World::new(11);
    slants(&mut world);
    world
}

/// The geometry of [`slanted`] and [`exposure`].
fn slants(world: &mut World) {
    use Pattern::{Blotches, Checker, Plain, Rings};
    // Two walls that meet in a corner, and a floor.
    world.plane([0.25, 0.0, 3.3], [0.55, 0.0, -1.0], paint(Blotches(0.5), [0xb9a482, 0x8f9a86]));
    world.plane([0.25, 0.0, 3.3], [-0.75, 0.0, -1.0], paint(Blotches(0.4), [0x8695a8, 0xa9a0a6]));
    world.plane([0.0, 0.6, 1.2], [0.0, -1.0, -0.12], paint(Plain, [0xa8845c, 0]).stretch([1.0, 0.35, 1.0]));
    // Cards that lean back, forward and sideways.
    world.card(
        [-0.55, -0.12, 1.75],
        [0.8, -0.35, -1.0],
        [0.2, -1.0, 0.0],
        [0.24, 0.3],
        paint(Blotches(0.12), [0xd9c563, 0x9c4f34]),
    );
    world.card(
        [0.75, -0.35, 2.2],
        [-0.2, 0.6, -1.0],
        [-0.35, -1.0, 0.0],
        [0.34, 0.24],
        paint(Checker(0.115), [0x3f6b8c, 0xcbd3cf]),
    );
    world.disc([0.05, -0.52, 2.3], [-0.5, -0.4, -1.0], 0.32, paint(Blotches(0.2), [0x6c8f4e, 0xc8c98a]));
    // Curved bodies.
    world.ball([0.02, 0.25, 1.85], 0.27, [0.4, -1.0, -0.3], paint(Blotches(0.22), [0xb74a3a, 0xe0a87c]));
    world.bar(
        [0.42, 0.43, 1.45],
        [0.98, 0.37, 1.95],
        0.13,
        paint(Rings(0.2), [0x555886, 0xb8a8c4]).grain(0.2, 0.08),
    );
}

/// The geometry of [`slanted`] with another grain, and a right camera that is darker and adds an offset.
fn exposure() -> World {
    let mut world = World::new(12);
    slants(&mut world);
    world.sensors[1].gain = 0.72;
    world.sensors[1].offset = 14.0;
    world.sensors[1].noise = 1.5;
    world
}

/// Poles, leaning rods and a fence in front of a slanted background.
fn thin() -> World {
    use Pattern::{Blotches, Plain, Rings};
    let mut world = World::new(13);
    world.plane([0.0, 0.0, 3.0], [-0.5, -0.15, -1.0], paint(Blotches(0.45), [0x7f937a, 0xb7ab8d]));
    world.plane([0.0, 0.62, 1.2], [0.0, -1.0, -0.16], paint(Plain, [0x8d7a63, 0]));
    let floor = |x: f64, z: f64| [x, 0.62 - 0.16 * (z - 1.2), z];
    let lift = |p: Vec3, height: f64| [p[0], p[1] - height, p[2]];
    // A fence that recedes to the right: two rails and their pales.
    let wood = paint(Plain, [0xd8cfbd, 0]).grain(0.12, 0.05);
    let along = |t: f64| floor(-0.95 + 1.5 * t, 1.5 + 0.7 * t);
    for height in [0.16, 0.4] {
        world.bar(lift(along(-0.2), height), lift(along(1.0), height), 0.012, wood);
    }
    for i in -1..=9 {
        let foot = along(f64::from(i) / 9.0);
        world.card(lift(foot, 0.24), [0.42, 0.0, -0.9], UP, [0.022, 0.26], wood);
    }
    // Poles of several widths and depths, upright and leaning.
    let pole = |a, b| paint(Rings(0.22), [a, b]).grain(0.14, 0.05);
    world.bar(floor(0.3, 1.35), lift(floor(0.3, 1.35), 1.4), 0.016, pole(0xc23b2e, 0xe9e2d6));
    world.bar(floor(0.62, 1.7), lift(floor(0.62, 1.7), 1.8), 0.03, pole(0x3a557d, 0xd9d0b4));
    world.bar(floor(0.85, 2.3), lift(floor(0.95, 2.3), 2.2), 0.045, pole(0x546e3f, 0x8a9d66));
    world.bar([-0.62, -0.7, 1.3], [0.2, 0.42, 1.9], 0.011, pole(0x2f2c2a, 0x5b534b));
    world.bar([-0.35, -1.0, 2.0], [1.0, 0.55, 1.35], 0.014, pole(0xb9852e, 0xe0c078));
    // Wires across the whole view.
    let wire = paint(Plain, [0x33363c, 0]).grain(0.1, 0.05);
    world.bar([-2.0, -0.62, 2.0], [2.0, -0.42, 2.0], 0.009, wire);
    world.bar([-2.0, -0.52, 2.0], [2.0, -0.32, 2.0], 0.009, wire);
    world
}

/// A large plain wall with faint shading behind a few textured objects.
fn wall() -> World {
    use Pattern::{Blotches, Checker, Plain, Wash};
    let mut world = World::new(14);
    let plaster = paint(Wash(1.1), [0xcfc6b4, 0xd9d2c3]).grain(0.0, 1.0);
    world.plane([0.0, 0.0, 2.9], [0.12, 0.0, -1.0], plaster);
    let floor = paint(Plain, [0x7b5c43, 0]).stretch([0.25, 1.0, 1.0]);
    world.plane([0.0, 0.56, 1.2], [0.0, -1.0, -0.06], floor);
    world.block(
        [-0.62, 0.29, 1.85],
        [0.5, 0.0, -1.0],
        UP,
        [0.17, 0.26, 0.17],
        paint(Blotches(0.1), [0x3d5f73, 0x9bb4b0]),
    );
    world.ball([0.1, 0.34, 1.6], 0.19, [0.3, -1.0, 0.2], paint(Checker(0.09), [0xb54132, 0xe6d3b3]));
    world.bar([0.78, 0.53, 2.2], [0.78, -0.3, 2.2], 0.15, paint(Blotches(0.16), [0x597446, 0xb9b26e]));
    world.card(
        [0.06, -0.52, 2.87],
        [0.12, 0.0, -1.0],
        UP,
        [0.3, 0.22],
        paint(Blotches(0.14), [0x4b4e7b, 0xc99a5b]),
    );
    world
}

/// Periodic stripes and squares that are ambiguous except at their borders and at one object in front.
fn repetitive() -> World {
    use Pattern::{Blotches, Checker, Plain, Stripes};
    let mut world = World::new(15);
    let faint = |pattern, colours| paint(pattern, colours).grain(0.012, 0.1);
    world.plane([0.0, 0.0, 2.8], VIEWER, paint(Blotches(0.4), [0x6f6459, 0xa39884]));
    // A panel of stripes on the left and one of squares on the right, in one plane.
    world.card([-0.62, -0.12, 2.4], VIEWER, UP, [0.6, 0.78], faint(Stripes(0.15), [0xd6cdb8, 0x465a72]));
    world.card([0.66, -0.12, 2.4], VIEWER, UP, [0.6, 0.78], faint(Checker(0.08), [0xcfc9bd, 0x7a3d35]));
    world.plane([0.0, 0.6, 1.2], [0.0, -1.0, -0.1], paint(Plain, [0x8a7255, 0]).stretch([0.3, 1.0, 1.0]));
    world.ball([-0.1, 0.34, 1.6], 0.22, [0.2, -1.0, 0.3], paint(Blotches(0.16), [0x4f784a, 0xd2c27a]));
    world
}

/// A nearly textureless wall behind a few textured objects; the vignetting of the two cameras has different centres.
fn light() -> World {
    use Pattern::{Blotches, Checker, Plain, Rings};
    let mut world = World::new(17);
    for (sensor, x) in world.sensors.iter_mut().zip([0.14, -0.12]) {
        sensor.fall_off = 0.12;
        sensor.brightest = [x, -0.05];
    }
    world.plane([0.0, 0.0, 2.7], [-0.2, -0.08, -1.0], paint(Plain, [0xf2ece0, 0]).grain(0.0034, 0.14));
    world.ball([0.1, 0.18, 1.42], 0.22, [0.3, -1.0, 0.2], paint(Checker(0.11), [0x9c3f36, 0xdfcfae]));
    world.block(
        [-0.66, 0.6, 1.75],
        [0.45, 0.0, -1.0],
        UP,
        [0.17, 0.42, 0.17],
        paint(Blotches(0.1), [0x35566b, 0xa3b8ae]),
    );
    world.bar([0.86, 1.3, 2.1], [0.86, -0.32, 2.1], 0.13, paint(Rings(0.17), [0x5b6f3e, 0xb5ae76]));
    world
}

/// A floor at a grazing angle, a plain wall that runs past the viewer, and pillars at the left border, which the right view shows only in
/// part.
fn steep() -> World {
    use Pattern::{Blotches, Plain, Rings};
    let mut world = World::new(18);
    world.plane(
        [0.0, 0.0, 5.0],
        [0.75, 0.0, -1.0],
        paint(Blotches(0.6), [0x8b7f98, 0xa9a389]).grain(0.16, 0.2),
    );
    let plaster = paint(Plain, [0xc9bfae, 0]).grain(0.006, 0.12);
    world.plane([0.0, 0.0, 5.0], [-1.6, 0.0, -1.0], plaster);
    // The disparity of the floor grows by 0.75 pixels per row, up to the largest label.
    world.plane([0.0, 0.507, 1.02], [0.0, -1.0, 0.284], paint(Plain, [0x94805f, 0]).grain(0.2, 0.12));
    world.bar(
        [-0.99, 0.72, 1.55],
        [-0.99, 0.22, 1.55],
        0.086,
        paint(Rings(0.19), [0xa8503c, 0xd8c4a0]).grain(0.14, 0.06),
    );
    world.bar([-0.95, 0.95, 2.2], [-1.23, -1.2, 2.0], 0.07, paint(Plain, [0x4f6b85, 0]).grain(0.14, 0.06));
    world.bar([-0.42, 0.85, 1.9], [-0.42, -1.2, 1.9], 0.05, paint(Plain, [0x6d7a46, 0]).grain(0.14, 0.06));
    world.bar(
        [0.55, 0.85, 1.75],
        [0.55, -0.3, 1.75],
        0.09,
        paint(Blotches(0.12), [0x3f4a6b, 0xc2a067]).grain(0.14, 0.06),
    );
    world
}

/// A white wall that runs past the viewer, blank except for a poster at its far end.
fn poster() -> World {
    use Pattern::{Blotches, Checker, Plain};
    let mut world = World::new(19);
    let face = [0.45, 0.0, -1.0];
    world.plane([0.0, 0.0, 2.4], face, paint(Plain, [0xe9e4da, 0]).grain(0.002, 0.3));
    world.card([0.52, -0.24, 2.63], face, UP, [0.36, 0.44], paint(Blotches(0.16), [0x3f5d86, 0xd9b25e]));
    let boards = paint(Plain, [0x8a6547, 0]).grain(0.2, 0.08).stretch([0.3, 1.0, 1.0]);
    world.plane([0.0, 0.52, 1.1], [0.0, -1.0, -0.08], boards);
    world.block(
        [0.1, 0.36, 1.55],
        [-0.4, 0.0, -1.0],
        UP,
        [0.16, 0.16, 0.12],
        paint(Checker(0.1), [0x59734c, 0xcdbb83]),
    );
    world.ball([-0.42, 0.36, 1.3], 0.13, [0.3, -1.0, 0.2], paint(Blotches(0.1), [0xa8432f, 0xe6c9a0]));
    world
}

/// A dark screen that reflects a window behind the viewer, in front of a wall with an object on it.
fn screen() -> World {
    use Pattern::{Blotches, Plain, Rings};
    let mut world = World::new(20);
    world.plane([0.0, 0.0, 2.7], [-0.15, 0.0, -1.0], paint(Blotches(0.3), [0x9c948a, 0x7b8791]));
    let wood = paint(Plain, [0x9a6d42, 0]).grain(0.18, 0.1).stretch([0.2, 1.0, 1.0]);
    world.plane([0.0, 0.5, 1.05], [0.0, -1.0, -0.16], wood);
    // The window, and its bars.
    let window = [-1.75, -1.1, -2.5];
    world.card(window, [0.4, 0.2, 1.0], UP, [0.7, 0.6], paint(Plain, [0xffffff, 0]).grain(0.0, 1.0));
    for half in [[0.05, 0.6], [0.7, 0.05]] {
        let bar = paint(Plain, [0x2a2622, 0]).grain(0.0, 1.0);
        world.card(add(window, [0.0, 0.0, 0.05]), [0.4, 0.2, 1.0], UP, half, bar);
    }
    // The screen in its frame.
    let face = [-0.25, -0.08, -1.0];
    world.card([0.14, -0.1, 1.86], face, UP, [0.5, 0.34], paint(Plain, [0x33312f, 0]).grain(0.1, 0.05));
    world.card(
        [0.137, -0.1, 1.845],
        face,
        UP,
        [0.46, 0.3],
        paint(Plain, [0x0d1013, 0]).grain(0.0, 1.0).gloss(0.9),
    );
    world.bar([-0.72, 0.5, 1.6], [-0.72, -0.25, 1.6], 0.09, paint(Rings(0.15), [0x40617a, 0xcfc3a2]));
    world.ball([0.42, 0.31, 1.28], 0.1, [0.5, -1.0, 0.2], paint(Blotches(0.09), [0xb0503b, 0xe2cf9b]));
    world
}

/// A floor and a slanted wall that reach the left border, where the right view does not show them.
fn border() -> World {
    use Pattern::{Blotches, Plain, Rings};
    let mut world = World::new(21);
    world.plane([0.0, 0.56, 1.25], [0.03, -1.0, -0.12], paint(Plain, [0x9b8f7a, 0]).grain(0.03, 0.12));
    world.plane(
        [0.4, 0.0, 3.2],
        [0.7, 0.0, -1.0],
        paint(Blotches(0.5), [0xb3a58c, 0x8d9a94]).grain(0.1, 0.12),
    );
    world.plane([0.4, 0.0, 3.2], [-0.5, 0.0, -1.0], paint(Blotches(0.4), [0x7f8ea3, 0xaaa29d]));
    world.bar([0.55, 0.6, 1.5], [0.55, -0.1, 1.5], 0.1, paint(Rings(0.17), [0xa8503c, 0xd8c4a0]));
    world.ball([0.05, 0.32, 1.9], 0.2, [0.4, -1.0, -0.3], paint(Blotches(0.18), [0x4f6f8c, 0xd6cfae]));
    world
}

fn corridor() -> World {
    use Pattern::{Blotches, Plain, Stripes};
    let mut world = World::new(22);
    let plaster = |colour| paint(Plain, [colour, 0]).grain(0.004, 0.2);
    world.plane([0.0, 0.0, 4.6], VIEWER, paint(Blotches(0.3), [0x77808a, 0xa89f90]));
    for (x, colour) in [(-0.8, 0xe3dccd), (0.8, 0xd9d4c8)] {
        world.card([x, 0.0, 2.8], [-x, 0.0, 0.0], UP, [1.75, 0.6], plaster(colour));
        let skirting = paint(Plain, [0x6b5a48, 0]).grain(0.15, 0.06);
        world.card([0.99 * x, 0.52, 2.8], [-x, 0.0, 0.0], UP, [1.75, 0.04], skirting);
    }
    world.card([0.0, -0.56, 2.8], [0.0, 1.0, 0.0], VIEWER, [0.8, 1.75], plaster(0xf0ede6));
    world.card([0.0, 0.56, 2.8], UP, VIEWER, [0.8, 1.75], paint(Blotches(0.14), [0x5f5a6b, 0x8c7a66]));
    world.card(
        [-0.79, 0.1, 2.3],
        [1.0, 0.0, 0.0],
        UP,
        [0.3, 0.46],
        paint(Stripes(0.2), [0x7a5536, 0x94714c]),
    );
    world.card(
        [0.79, 0.1, 3.2],
        [-1.0, 0.0, 0.0],
        UP,
        [0.3, 0.46],
        paint(Stripes(0.2), [0x3f5a70, 0x5f7c8c]),
    );
    world.block(
        [0.3, 0.42, 1.4],
        [-0.3, 0.0, -1.0],
        UP,
        [0.13, 0.13, 0.1],
        paint(Blotches(0.08), [0x7c6a4f, 0xcdbf9d]),
    );
    world
}

/// Nearby pillars that each occlude a wide region of the background, in which two surfaces meet.
fn behind() -> World {
    use Pattern::{Blotches, Rings};
    let mut world = World::new(23);
    world.plane([0.0, 0.0, 4.2], [0.1, 0.0, -1.0], paint(Blotches(0.5), [0x8f8a9c, 0xb0a58d]));
    // Screens at half the depth: the first ends beside its pillar, the second continues behind it.
    let cloth = |a, b| paint(Blotches(0.18), [a, b]);
    world.card([-0.78, 0.0, 2.1], [0.15, 0.0, -1.0], UP, [0.36, 0.62], cloth(0x557a6a, 0xcfc48e));
    world.card([0.62, -0.1, 2.3], [-0.25, 0.0, -1.0], UP, [0.5, 0.5], cloth(0x8a4f46, 0xd3b79b));
    world.plane([0.0, 0.56, 1.15], [0.0, -1.0, -0.1], paint(Blotches(0.2), [0x87715a, 0xa69680]));
    let pillar = |a, b| paint(Rings(0.16), [a, b]).grain(0.14, 0.06);
    world.bar([-0.06, 0.7, 1.2], [-0.06, -0.8, 1.2], 0.09, pillar(0x3f5f80, 0xd2d0c2));
    world.bar([0.44, 0.7, 1.25], [0.44, -0.8, 1.25], 0.08, pillar(0x70455e, 0xd9c6a5));
    world
}

/// A still life with a mixture of difficulties.
fn mixed() -> World {
    use Pattern::{Blotches, Checker, Plain, Rings, Stripes, Wash};
    let mut world = World::new(16);
    // A plastered wall and a wooden table that rises towards it.
    world.plane(
        [0.0, 0.0, 3.0],
        [-0.22, 0.0, -1.0],
        paint(Wash(0.9), [0x8fa3a6, 0xa9b5ac]).grain(0.035, 0.3),
    );
    let wood = paint(Plain, [0xb07d4d, 0]).grain(0.17, 0.1).stretch([0.12, 1.0, 1.0]);
    world.plane([0.0, 0.6, 1.04], [0.0, -1.0, -0.14], wood);
    let table = |x: f64, z: f64| [x, 0.6 - 0.14 * (z - 1.04), z];
    let up = unit([0.0, -1.0, -0.14]);
    let above = |p: Vec3, height: f64| add(p, scale(up, height));
    // A picture on the wall.
    let face = [-0.22, 0.0, -1.0];
    world.card([0.62, -0.62, 2.83], face, UP, [0.42, 0.32], paint(Plain, [0x4a3527, 0]));
    world.card([0.617, -0.62, 2.815], face, UP, [0.36, 0.26], paint(Blotches(0.22), [0xd8b46a, 0x46637e]));
    // A crate with a ball on it.
    let crate_paint = paint(Stripes(0.12), [0xa24b3a, 0xd9c7a4]);
    world.block(above(table(0.55, 2.05), 0.21), [-0.5, 0.14, -1.0], up, [0.23, 0.21, 0.2], crate_paint);
    world.ball(
        above(table(0.55, 2.05), 0.55),
        0.13,
        [0.5, -1.0, 0.2],
        paint(Blotches(0.1), [0x5d7f4c, 0xd5cf8f]),
    );
    // A tall vase with rods in it.
    let vase = table(-0.02, 2.3);
    world.bar(vase, above(vase, 0.55), 0.15, paint(Rings(0.18), [0x3e5c84, 0xc9d2d6]).grain(0.12, 0.1));
    for (x, z, r, c) in
        [(-0.3, 0.1, 0.012, 0x6a4a2c), (0.05, -0.05, 0.016, 0x8a6a3c), (0.32, 0.05, 0.01, 0x5a5238)]
    {
        let tip = add(above(vase, 1.15), [x, 0.0, z]);
        world.bar(above(vase, 0.45), tip, r, paint(Plain, [c, 0]).grain(0.12, 0.05));
    }
    // Balls in front.
    world.ball(
        above(table(-0.52, 1.65), 0.24),
        0.24,
        [0.5, -1.0, 0.6],
        paint(Checker(0.12), [0xc8922e, 0xefe2c4]).grain(0.1, 0.1),
    );
    world.ball(
        above(table(0.2, 1.42), 0.12),
        0.12,
        [0.0, -1.0, 0.4],
        paint(Blotches(0.14), [0xc24a36, 0xe38a58]),
    );
    // A book lying on the table, and a card leaning against the wall.
    world.block(
        above(table(-0.12, 1.3), 0.025),
        [0.45, 0.14, -1.0],
        up,
        [0.15, 0.025, 0.11],
        paint(Blotches(0.08), [0x445a48, 0xb8b490]),
    );
    world.card(
        [-0.95, 0.02, 2.45],
        [0.35, -0.3, -1.0],
        [0.1, -1.0, 0.0],
        [0.24, 0.33],
        paint(Checker(0.11), [0x5b4a74, 0xb9a5bd]),
    );
    // A single upright stick.
    world.bar(
        table(0.8, 1.5),
        above(table(0.76, 1.5), 0.9),
        0.014,
        paint(Rings(0.16), [0xb8332c, 0xf0eadc]).grain(0.08, 0.05),
    );
    world
}

/// The still life with a right camera whose image is lower by a fraction of a row.
fn rows() -> World {
    let mut world = mixed();
    world.sensors[1].lower = 0.6;
    world
}

/// The still life with a right camera out of focus.
fn focus() -> World {
    let mut world = mixed();
    world.sensors[1].spread = 5.0;
    world
}

/// The still life in the dark, with noise in both sensors.
fn grain() -> World {
    let mut world = mixed();
    world.sensors.iter_mut().for_each(|sensor| sensor.noise = 12.0);
    world
}
