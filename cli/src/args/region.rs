//! A region of the left view.

use mrfgs::image::Rect;

/// The region to match.
#[derive(clap::Args)]
pub(crate) struct RegionArgs {
    /// Matches this part of LEFT alone, its first column and row, width and height in pixels: all outputs are of that part. It takes
    /// the time of the part, its range and 32 pixels around
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    pub(crate) roi: Option<Rect>,
}

fn region(text: &str) -> Result<Rect, String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let parsed = || {
        let [x, y, width, height] = *numbers.as_deref()? else { return None };
        let sizes = width > 0 && height > 0;
        let [right, bottom] = [x.checked_add(width)?, y.checked_add(height)?];
        sizes.then_some(Rect { x: x..right, y: y..bottom })
    };
    parsed().ok_or_else(|| "give first column, first row, width and height, such as 200,100,320,240".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_four_numbers() {
        assert_eq!(region("20, 10,30,40"), Ok(Rect { x: 20..50, y: 10..50 }));
        for text in
            ["", "1,2,3", "1,2,3,4,5", "1,2,0,4", "-1,2,3,4", "1,2,3.5,4", "1,2,18446744073709551615,4"]
        {
            assert!(region(text).is_err(), "{text}");
        }
    }
}
