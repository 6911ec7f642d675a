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
