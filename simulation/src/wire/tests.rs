use super::*;

#[test]
fn a_scenario_says_which_body_each_agent_has() {
    let text = "seed = 1\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 4 }\n\
                [[bodies]]\nagents = [3, 1]\nkind = \"aerial\"\n[[bodies]]\nagents = [2]\nradius_m = 0.2\n";
    let message = scenario(&Scenario::parse("s.toml", text, &[]).unwrap(), &Extent::new([20; 3], 1.0).unwrap(), 10);
    assert_eq!(message.body_of, [0, 1, 2, 1]);
    let bodies: Vec<_> = message.bodies.iter().map(|body| (body.kind, body.radius_m, body.speed_max_m_s)).collect();
    assert_eq!(bodies, [(0, 0.4, 1.5), (1, 0.4, 3.0), (0, 0.2, 1.5)]);
}

#[test]
fn interventions_are_read_as_they_were_written() {
    let pose = Pose { position: Point3::new(1.0, 2.0, 3.0), yaw_rad: 0.5 };
    for done in [Change::Place(pose), Change::Remove, Change::Leave, Change::Join(pose)] {
        assert_eq!(change(&intervention(Tick(7), AgentId(3), &done)), Ok(done));
    }
    let unknown = maes_msgs::Intervention { kind: 4, ..Default::default() };
    assert_eq!(change(&unknown), Err("an intervention of kind 4: expected 0 to 3".to_owned()));
}

#[test]
fn transforms_have_no_digits_below_a_nanometre() {
    let transform = |x: f64, yaw_rad: f64| geometry_msgs::Transform {
        translation: geometry_msgs::Vector3 { x, y: -x, z: 0.0 },
        rotation: rotation(yaw_rad),
    };
    for (x, yaw_rad) in [(0.1, 0.7), (99.95 / 3.0, -3.1), (1023.999_999, 1e-12)] {
        let (exact, rounded) = (transform(x, yaw_rad), rounded_transform(&transform(x, yaw_rad)));
        let components =
            |it: &geometry_msgs::Transform| [it.translation.x, it.translation.y, it.rotation.z, it.rotation.w];
        for (exact, rounded) in components(&exact).into_iter().zip(components(&rounded)) {
            assert!((exact - rounded).abs() <= 1.2e-10, "{exact} {rounded}");
            assert_eq!((rounded * 4_294_967_296.0).fract(), 0.0);
        }
        assert_eq!(rounded_transform(&rounded), rounded, "once is enough");
    }
}
