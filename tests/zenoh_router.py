"""A Zenoh router that stands in for `rmw_zenohd`.

    zenoh_router.py ENDPOINT

Listens at an endpoint (`tcp/127.0.0.1:7447`), introduces its peers to each other, prints `ready`, and serves until
it is killed. Needs the package eclipse-zenoh.
"""

import signal
import sys

import zenoh

# What the default configuration of rmw_zenohd sets.
CONFIG = """{
  mode: "router",
  listen: { endpoints: ["%s"] },
  scouting: {
    multicast: { enabled: false },
    gossip: {
      target: { router: ["router", "peer"], peer: ["router"] },
      autoconnect: { router: [], peer: ["router", "peer"] },
    },
  },
  timestamping: { enabled: true },
  routing: { router: { peers_failover_brokering: true } },
}"""

with zenoh.open(zenoh.Config.from_json5(CONFIG % sys.argv[1])):
    print("ready", flush=True)
    signal.pause()
