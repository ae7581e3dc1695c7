//! Contact sheets.

use smaclite_view::{Cell, Picture, Sheet, Theme};

use crate::kit::*;

fn picture(width: u32, height: u32) -> Picture {
    let scenario = standard("3m");
    render(&scenario, size(width, height), &[start(&scenario)])
}

/// How often `picture` is in `sheet`.
fn count(sheet: &Picture, picture: &Picture) -> usize {
    let row = |of: &Picture, x: u32, y: u32, width: u32| {
        let at = (y * of.width() + x) as usize * 3;
        of.rgb()[at..at + width as usize * 3].to_vec()
    };
    let is_at = |x: u32, y: u32| {
        let width = picture.width();
        (0..picture.height()).all(|i| row(sheet, x, y + i, width) == row(picture, 0, i, width))
    };
    let (columns, rows) = (sheet.width() - picture.width(), sheet.height() - picture.height());
    (0..=rows).flat_map(|y| (0..=columns).map(move |x| (x, y))).filter(|&(x, y)| is_at(x, y)).count()
}

#[test]
fn a_sheet_contains_all_pictures() {
    let (small, large) = (picture(40, 20), picture(64, 48));
    for theme in [Theme::Dark, Theme::Light] {
        for (columns, expected) in [(0, 2), (1, 1), (3, 3), (99, 3)] {
            let cells = [
                Cell { picture: &small, caption: "3m #0" },
                Cell { picture: &large, caption: "" },
                Cell { picture: &small, caption: "a caption that is much too long \u{1f600}" },
            ];
            let sheet = Sheet { columns, theme }.compose(&cells).unwrap();
            assert_eq!((count(&sheet, &small), count(&sheet, &large)), (2, 1));
            assert_eq!(sheet.width() / 64, expected, "{columns} columns");
            let size = Sheet { columns, theme }.size(3, 64, 48).unwrap();
            assert_eq!((sheet.width(), sheet.height()), size);
            assert_eq!(sheet, Sheet { columns, theme }.compose(&cells).unwrap());
        }
    }
}

#[test]
fn captions_are_written() {
    let picture = picture(64, 48);
    let sheet = |caption| Sheet::default().compose(&[Cell { picture: &picture, caption }]).unwrap();
    assert_ne!(sheet("2s3z"), sheet("2s3"));
    assert_ne!(sheet("2s3z"), sheet(""));
}

#[test]
fn empty_and_too_large_sheets() {
    let empty = Sheet::default().compose(&[]).unwrap();
    assert!(empty.width() >= Picture::MIN_SIDE && empty.height() > 0);
    let picture = picture(1024, 16);
    let cells = [Cell { picture: &picture, caption: "" }; 16];
    let error = Sheet { columns: 16, ..Sheet::default() }.compose(&cells).unwrap_err();
    assert!(error.to_string().contains("and 16384 pixels, got 16928 x "), "{error}");
    assert_eq!(Sheet { columns: 16, ..Sheet::default() }.size(16, 1024, 16), Err(error));
    assert!(Sheet::default().size(usize::MAX, 16, 16).is_err());
}
