//! `mrfgs demo`.

use super::*;

#[test]
fn the_demo_gives_the_map_of_the_command_it_prints() {
    let folder = Folder::new();
    let told = run(&folder, "demo").succeeded();
    told.says("320 x 240, 48 disparities & points; unit: m");
    for (name, scene) in [("left.png", "mixed/im0.png"), ("right.png", "mixed/im1.png")] {
        assert_eq!(
            fs::read(folder.join("mrfgs-demo").join(name)).unwrap(),
            fs::read(self::scene(scene)).unwrap()
        );
    }
    let shown = told.stdout.lines().find_map(|line| line.strip_prefix("This was mrfgs ")).unwrap();
    let again = Folder::new();
    fs::create_dir(again.join("mrfgs-demo")).unwrap();
    for name in ["left.png", "right.png"] {
        fs::copy(folder.join("mrfgs-demo").join(name), again.join("mrfgs-demo").join(name)).unwrap();
    }
    run(&again, shown).succeeded();
    for name in ["disparity.pfm", "disparity.view.html", "disparity.preview.png", "disparity.points.ply"] {
        told.prints(name);
        let [first, again] =
            [&folder, &again].map(|folder| fs::read(folder.join("mrfgs-demo").join(name)).unwrap());
        assert!(first == again, "{name}");
    }
    // A second run replaces the folder, unless it contains other files.
    let before = listing(&folder);
    run(&folder, "demo").succeeded().prints("This was mrfgs match");
    assert!(listing(&folder) == before);
    let mine = folder.join("mrfgs-demo/mine.txt");
    fs::write(&mine, "my own").unwrap();
    run(&folder, "demo").failed(1, "mrfgs-demo & the folder is not empty; give a new one");
    fs::remove_file(mine).unwrap();
    fs::copy(scene("wall/im0.png"), folder.join("mrfgs-demo/left.png")).unwrap();
    run(&folder, "demo").failed(1, "mrfgs-demo & the folder is not empty; give a new one");
}

#[test]
fn a_folder_with_other_files_is_left_alone() {
    let folder = Folder::new();
    fs::create_dir(folder.join("mine")).unwrap();
    fs::write(folder.join("mine/left.png"), "my own").unwrap();
    run(&folder, "demo mine").failed(1, "mine & the folder is not empty; give a new one");
    assert_eq!(fs::read(folder.join("mine/left.png")).unwrap(), b"my own");
    run(&folder, "demo absent/deep").failed(1, "absent");
    run(&folder, "").failed(2, "give a command: demo, match & try `mrfgs demo`");
}
