fn main() {
    use damprig_board::*;
    use damprig_core::model::*;
    use damprig_core::plant::*;
    let image = Image::read(std::path::Path::new(&std::env::args().nth(1).unwrap())).unwrap();
    let structure = Structure::from_modal(1.6, 2.5, 0.0038);
    let mut config = PlantConfig::ideal(SetUp { structure, particle: None, friction_damper: None, tmd: None, gravity_m_per_s2: 9.81 });
    config.base = Base::Shaker(Shaker::default());
    let mut board = Board::new(image, &Config::new(config)).unwrap();
    let begun = std::time::Instant::now();
    for ms in 1..=3000u64 {
        if let Err(failure) = board.run_until(Time::from_ms(ms)) {
            println!("{failure}");
            break;
        }
        let sent = board.chip_mut().take_sent();
        if !sent.is_empty() { println!("{ms} ms: {} bytes", sent.len()); }
    }
    println!("{} instructions, {} exceptions, device {} s in {:?}", board.instructions(), board.exceptions(), board.now().s(), begun.elapsed());
    println!("{:?}", board.chip().deviations());
    for (t, o) in board.chip().trace() { println!("{:.6} {o:?}", t.s()); }
}
