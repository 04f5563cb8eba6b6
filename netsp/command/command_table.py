"""Commands of netsp and their options: the whole command line on one page."""

from __future__ import annotations

import argparse

from netsp.command.command_options import (
    CLEARANCE,
    ITERATION_LIMIT,
    JSON,
    LINK,
    PARAMS,
    PROBLEM,
    QUIET,
    RUN_FOLDER,
    SAMPLES,
    SEED,
    SILENT,
    VEHICLE_FRAMES,
    Data,
    Group,
    Input,
    OneOf,
    Option,
    Output,
    Picture,
    frame,
    friction,
    page,
    seed,
    surprises,
    time_limit,
)
from netsp.command.types import (
    count_or_range,
    depth,
    length,
    natural,
    option,
    positive,
    seconds,
    shard,
    system_id,
    whole_bytes,
)


class Command:
    """Command of netsp.

    Parameters
    ----------
    text : str
        Line of help.
    example : str
        Command line that shows its use, beginning with the name of the command.
    *options : Option
        Its options.
    module : str, optional
        Module of this package with its function `run`. By default, it is named as the command.
    """

    def __init__(
        self, text: str, example: str, *options: Option | Group | OneOf, module: str | None = None
    ) -> None:
        self.text, self.example, self.options = text, example, options
        self.module = f"netsp.command.{module or example.split()[1].replace('-', '_')}"


FOR_ALL = (
    Input("PROBLEM", "problem file or mission file (JSON); a mission is written with its tour"),
    Option(
        "--solver NAME",
        "auto (default), mip, dp, reduced-mip, mip-2017, lns, anneal, anneal-2016, greedy, "
        "greedy-2016 or greedy-tsp",
        default="auto",
        group="netsp.solvers",
    ),
    PARAMS,
    Option("--mip-backend NAME", "highs (default) or cbc, for the solvers built on mip"),
    time_limit(
        "seconds for reading, roadmap, legs and solver together; default no limit, for missions 60"
    ),
    ITERATION_LIMIT,
    SEED,
    Data(
        "-o, --output FILE",
        "write the solution, or the planned mission, to this file (default: stdout)",
    ),
    Picture("--plot FILE", "draw the solution (png, svg or pdf)"),
    *CLEARANCE,
    QUIET,
    JSON,
)
"""Options for problems and missions."""

FOR_PROBLEMS = (
    Option("--roadmap NAME", "taut (default) or prm", default="taut", group="netsp.roadmaps"),
    Option(
        "--classes RULE",
        "taut: all homotopy classes (default), or non-looping as in the 2017 paper",
        dest="classes_rule",
    ),
    SAMPLES,
    Option("--shortcut", "prm: pull every leg taut within its class"),
    Option("--max-classes N", "taut: upper limit on the classes of all goals together", positive),
    Option(
        "--keep-order",
        "visit the goals in the order of the file; only their homotopy classes are chosen",
    ),
    Output(
        "--proof FILE",
        "prove the tour and write the proof, which `netsp verify --proof` and `python -m "
        "netsp_check` check without the solver (roadmap taut only)",
    ),
    Output(
        "--proof-vipr FILE",
        "with --proof: also write the integer program of the proof in the format of VIPR, whose "
        "checker then derives the bound from it",
    ),
    Option(
        "--slack S",
        "slack tether that must fit in addition, as a share of the taut length, such as 0.05",
        length,
        0.0,
    ),
    friction("coefficient of friction of tether on obstacle, 0 to 10"),
    Option(
        "--max-tension-ratio K",
        "use only classes in which friction multiplies the tension by at most K",
        length,
    ),
    Option(
        "--margin R",
        "plan so that every obstacle may be off by R (docs/guide/tether-and-station.md)",
        length,
        0.0,
    ),
    Input(
        "--warm-start SOLUTION",
        "start from this solution's tour; it may be of an older version of the problem",
    ),
    Picture(
        "--plot-trace FILE",
        "plot length, bound and entanglement against iterations (png, svg or pdf)",
    ),
)

SOLVE = Command(
    "find the shortest non-entangling tour of a problem or a mission",
    "netsp solve problems/wharf.json -o solution.json --plot wharf.png",
    *FOR_ALL,
    Group("for problems only", FOR_PROBLEMS),
)

APP = Command(
    "plan on a map in the browser",
    "netsp app problems/wharf.json",
    Option(
        "[PROBLEM]",
        "problem file (JSON), created if it does not exist, or a map of a site "
        "(docs/guide/bring-your-site-in.md); with --show a solution file or the folder of a run; "
        "default: an empty map",
    ),
    Option(
        "--show",
        "view a solution (with --problem), or a run of `netsp execute` or `simulate`, without "
        "editing",
    ),
    Option(
        "--problem FILE", "with --show: the problem that the solution solves", dest="problem_file"
    ),
    Option("--port N", "port to listen on; default: a free one", int, 0),
    Option("--time-limit S", "seconds of solving after each edit", positive, 60),
    Option("--no-browser", "print the address without opening a browser"),
)

COVER = Command(
    "place waypoints that see a structure",
    "netsp cover scenes/jetty.json --anchor=-3,-3,-1 -o mission.json",
    Input("SCENE", "scene file (JSON)"),
    Option("--anchor X,Y,Z", "where the tether is fixed (m)", required=True),
    Option("--start X,Y,Z", "where the robot starts; default the anchor"),
    Option("--tether L", "tether length (m); default a tenth more than the waypoints need", length),
    Option(
        "--standoff D", "distance from the surface (m); default half the camera's range", length
    ),
    Option(
        "--camera RANGE[,FIELD[,TILT]]",
        "range of sight (m), full angle of the field of view and maximum tilt (degrees); default "
        "2,70,90",
        default="2",
    ),
    Option("--patch S", "side of the surface patches whose visibility is counted (m)", length, 0.2),
    Option("--clearance R", "distance to keep from all solids (m)", length, 0.3),
    Option(
        "--share S",
        "share of the visible surface that the waypoints must see, 0 to 1",
        length,
        0.99,
    ),
    Option(
        "--incidence DEG",
        "largest angle between a line of sight and the normal of the surface (degrees)",
        length,
        75.0,
    ),
    Option(
        "--farthest D",
        "largest distance from the camera to a patch (m); default the camera's range",
        length,
    ),
    Option(
        "--inspect NAME",
        "cover only this solid (or mesh, cloud, floor); may be repeated",
        repeats=True,
    ),
    Option(
        "--fewest",
        "choose the fewest waypoints; default: waypoints and tour together, for a short time",
    ),
    Option("--speed V", "speed of the robot (m/s); default that of missions, 0.3", length),
    time_limit("seconds for the whole command", 60.0),
    SEED,
    Data("-o, --output FILE", "write the mission to this file (default: stdout)"),
    Picture("--plot FILE", "draw the waypoints (png, svg or pdf)"),
    QUIET,
    JSON,
)

VERIFY = Command(
    "check a solution, independently of the solvers",
    "netsp verify problems/wharf.json solution.json",
    Input(
        "PROBLEM", "problem file, or a mission that was planned; for a path, also a scene (JSON)"
    ),
    Input("[SOLUTION]", "solution file (JSON) of the problem"),
    Option(
        "--measures",
        "print measures of entanglement; SOLUTION may then be any path (a file that netsp "
        "compare-path reads, or a JSON list of points)",
    ),
    Option("--margins", "also print the margins, as netsp margins does"),
    Input(
        "--proof FILE",
        "proof file that `netsp solve --proof` wrote: check that no tour is shorter; without "
        "SOLUTION, only check the proof",
    ),
    Output(
        "--problem-output FILE",
        "write the problem in the long form, which `python -m netsp_check` reads: without short "
        "forms such as inspect, any_of and bounds that are an outline",
    ),
    frame("frame of a path to measure: local (the problem's plane) or global (degrees)"),
    Option(
        "--system N",
        "the vehicle's system id in a .tlog to measure; default: the only one with positions",
        natural,
    ),
    Option("--quiet", "print nothing; the exit code is the answer"),
    Option("--json", "print the summary as JSON on stdout"),
)

MARGINS = Command(
    "find which errors of map and position a tour tolerates",
    "netsp margins problems/wharf.json solution.json --friction 0.2",
    PROBLEM,
    Input("SOLUTION", "solution file (JSON)"),
    friction("coefficient of friction of tether on obstacle, 0 to 10, for the tension ratios"),
    Output("-o, --output FILE", "write the margins (JSON)"),
)

PLOT = Command(
    "draw a problem or a scene, with a solution or a tether",
    "netsp plot problems/wharf.json solution.json -o wharf.svg",
    Input("PROBLEM", "problem, scene or mission file (JSON)"),
    Input(
        "[SOLUTION]",
        "solution; for a scene, a path that begins at the anchor (CSV x,y,z or JSON), along which "
        "the tether is laid",
    ),
    Output(
        "-o, --output FILE",
        "png, svg or pdf; a scene or a mission also html, interactive",
        required=True,
    ),
    Option("--tether-model NAME", "scene: geodesic (default) or react", default="geodesic"),
    Option("--delta L", "scene: resolution of the tether; default: by the scene", length),
    Option("--roadmap NAME", "draw this roadmap: taut or prm"),
    SAMPLES,
    Option("--seed N", "prm: random seed", natural, 0, shows_default=False),
    Option("--tethers-to GOAL", "draw all taut tethers to this goal (name or #index)"),
)

ANIMATE = Command(
    "animate a tour or a run",
    "netsp animate tour.json --problem problems/wharf.json -o tour.gif",
    Input(
        "SOURCE...",
        "a solution, a planned mission, or the folder of a run of `netsp execute` or `netsp "
        "simulate`; several stand side by side",
    ),
    Input("--problem FILE", "the problem of solution files"),
    Output(
        "-o, --output FILE", "gif, mp4 (extra video), or a page (html) with a slider", required=True
    ),
    Option("--seconds N", "duration of the animation", positive, 12),
    Option("--fps N", "frames per second", positive, 15),
    SILENT,
)

BASE = Command(
    "rank candidate places for the base",
    "netsp base problems/wharf.json --grid 10,10 --plot base.png",
    Input("PROBLEM", "problem file (JSON); the base in it is ignored"),
    OneOf(
        (
            Input(
                "--candidates FILE",
                "places from a table (CSV) with the columns x, y and optionally z, name",
            ),
            Option("--line X1,Y1,X2,Y2,N", "N places along a line, such as a quay"),
            Option(
                "--grid NX,NY",
                "a grid of places over the bounds; without bounds, over goals and obstacles",
            ),
        ),
        required=True,
    ),
    Option("--every", "also solve from places that are proven worse than the best"),
    Option("--top N", "number of places to print", positive, 10),
    time_limit("seconds; the best place found by then is written; default no limit"),
    seed("random seed of the solver"),
    Output("-o, --output FILE", "write the ranking: a table (.csv) or JSON"),
    Output("--problem-output FILE", "write the problem with its base at the best place"),
    Picture("--plot FILE", "draw both maps (.png, .svg or .pdf)"),
    SILENT,
)

TETHER = Command(
    "find how long a tether you need, and what a longer one saves",
    "netsp tether problems/wharf.json --longest 30 --plot tether.png",
    PROBLEM,
    Option(
        "--longest L",
        "longest tether to consider, in the problem's units; default: the problem's own",
        length,
    ),
    time_limit("seconds; the part of the curve known by then is written; default no limit"),
    seed("random seed of the solver"),
    Output("-o, --output FILE", "write the curve: a table (.csv) or JSON"),
    Picture("--plot FILE", "draw the curve (.png, .svg or .pdf)"),
    SILENT,
)

GTSP = Command(
    "solve any generalised TSP, in the format of GTSPLIB",
    "netsp gtsp examples/7ring28.gtsp -o ring.tour --plot ring.png",
    Input("FILE", "file in the format of TSPLIB or GTSPLIB", dest="instance"),
    Option(
        "--solver NAME",
        "auto (default), mip, dp, reduced-mip, lns, anneal or greedy",
        default="auto",
    ),
    PARAMS,
    time_limit("seconds; the best tour found by then is written; default no limit"),
    ITERATION_LIMIT,
    SEED,
    Data("-o, --output FILE", "write the tour, in TSPLIB's format, to this file (default: stdout)"),
    Picture("--plot FILE", "draw the tour (png, svg or pdf)"),
    QUIET,
    JSON,
)

WORLD = Command(
    "make a random problem; a seed gives the same one on every machine",
    "netsp world --goals 30 --tether 350 --seed 7 -o world.json",
    Option(
        "--family NAME",
        "icra2017 (default), rss2016, clustered, array or harbour",
        default="icra2017",
    ),
    SEED,
    Option("--goals N", "number of goals; default 20, rss2016: 5 to 10", positive),
    Option(
        "--obstacles N",
        "number of obstacles, or a range such as 1-20 to draw it from; default 20, rss2016: 5 to "
        "10",
        count_or_range,
    ),
    Option("--tether L", "tether length", length, 300.0),
    Option("--side L", "side of the square world", length, 500.0),
    Option(
        "--radii R R",
        "smallest and largest radius of obstacles; default 10 30",
        length,
        (10.0, 30.0),
    ),
    Output("-o, --output FILE", "write the problem to this file (default: stdout)"),
    Picture("--plot FILE", "draw the problem (png, svg or pdf)"),
)

SIMULATE = Command(
    "run a mission in a scene with a taut tether",
    "netsp simulate missions/basin.json -o run",
    Input("MISSION", "mission file (JSON)"),
    Option(
        "--planner NAME",
        "predictive (default), repair, react, react-draft, react-thresholds or none",
        default="predictive",
        group="netsp.planners",
    ),
    Option("--tether L", "tether length, instead of the mission's", length),
    Option(
        "--vehicle NAME",
        "kinematic (default) or bluerov2 (with its dynamics and controller)",
        default="kinematic",
    ),
    Option(
        "--tether-model NAME",
        "tether model of the planner: geodesic (default) or react",
        default="geodesic",
        group="netsp.tethers",
    ),
    Option("--current X,Y,Z", "current (m/s), instead of the mission's"),
    Option(
        "--paths NAME",
        "path planner: tree (default), or bitstar, rrtstar or prmstar (OMPL)",
        default="tree",
    ),
    Option(
        "--refine NAME",
        "refinement of paths: none, paper or gradient; default: as the planner says",
    ),
    Option(
        "--perturbation {free,farther}",
        "random moves that --refine paper accepts: all free ones (default), as in the paper, or "
        "only those that lead farther from solids",
        default="free",
    ),
    seed("random seed of gusts and of sampling planners"),
    Option("--compare NAME", "also run this planner, for comparison"),
    surprises(
        "solids that appear, vanish or move; waypoints added or cancelled; a robot pushed away"
    ),
    Option("--snap", "move waypoints out of solids"),
    Option(
        "--bracket",
        "also estimate how short and how long the tether may be where friction lets it hang",
    ),
    Option(
        "-o, --output RUN", "folder for log.csv, summary.json, run.png and (with plotly) run.html"
    ),
    QUIET,
    JSON,
)

EXECUTE = Command(
    "carry out a tour in simulation, and repair it after surprises",
    "netsp execute problems/wharf.json solution.json --surprise examples/surprises.json -o run",
    Input("PROBLEM", "problem file (JSON), or a mission that was planned"),
    Input("[SOLUTION]", "solution file (JSON) of a problem"),
    surprises("events during the run"),
    Option(
        "--speed V", "speed of the robot, in the problem's units per second; default 0.5", length
    ),
    Option("--vehicle NAME", "kinematic (default) or bluerov2", default="kinematic"),
    Option("--current X,Y,Z", "current (m/s); default none"),
    Option("--gusts S", "gusts added to the current (m/s)", length),
    Option(
        "--planner NAME",
        "repair (default), or none: keep to the plan whatever happens; in space, find a path to "
        "one waypoint after the other",
        default="repair",
    ),
    Option(
        "--planning-limit S",
        "seconds that a repair may take, while the robot holds its position; default 2, in space "
        "10",
        seconds,
    ),
    Option(
        "--reserve R",
        "tether that repairs keep in reserve, in the problem's units; default: as the plan does, "
        "at most a tenth of the limit",
        length,
    ),
    Option("--delta D", "resolution of the tether model; default by the smallest obstacle", length),
    seed("random seed of gusts and solvers"),
    RUN_FOLDER,
    QUIET,
    JSON,
)

ORDER = Command(
    "older name of solve, for missions", "netsp order missions/basin.json -o better.json", *FOR_ALL
)

FLY = Command(
    "carry out a tour with a vehicle, over MAVLink",
    "netsp fly problems/wharf.json tour.json --link udpin:0.0.0.0:14551 -o run",
    Input("[PROBLEM]", "problem file (JSON)"),
    Input("[TOUR]", "its solution file (JSON)", dest="solution"),
    Option(
        "--resume RUN",
        "resume the flight in this folder from where the vehicle is, in place of PROBLEM and TOUR; "
        "writes RUN/resumed unless -o names another folder",
    ),
    Option(
        "--class WORD",
        "begin where the vehicle is, with its tether in this class: numbers of obstacles from 1, "
        "negative from right to left, such as --class=-1,2; '' for a straight tether",
        dest="word",
    ),
    Input(
        "--class-from FILE",
        "begin where the vehicle is, with the tether in the state file of netsp guard",
    ),
    LINK,
    Option("--dry-run", "show what would be sent, and send nothing"),
    Option("--system N", "system id of the vehicle; others are ignored", system_id, 1),
    Option(
        "--any-vehicle",
        "command any vehicle, not only an ArduPilot submarine; for experts: others use the same "
        "numbers for other modes",
    ),
    frame(f"{VEHICLE_FRAMES}; default global where the problem has an origin"),
    Option(
        "--speed V",
        "cruise speed of the vehicle, m/s, used to predict times and to compare repairs",
        length,
        0.5,
    ),
    Option("--reach R", "distance at which a vertex or goal counts as reached, m", length, 0.3),
    Option("--pace F", "simulation speed-up; 1 for a real vehicle", length, 1.0),
    Option(
        "--at-end {hold,position-hold,surface,leave}",
        "after the flight: hold the position in GUIDED (hold) or POSHOLD (position-hold), or come "
        "to the surface, until another ground station is heard or Ctrl-C; or leave the vehicle as "
        "it is; default hold",
        default="hold",
    ),
    surprises("events during the flight"),
    Option(
        "--events",
        'read events from standard input, one JSON object per line: {"cancel_goal": "A3"}',
    ),
    page("serve a page on this computer that shows the flight and accepts events"),
    Option(
        "--planning-limit S",
        "seconds that a repair may take, while the vehicle holds its position; default 2",
        seconds,
    ),
    Option(
        "--reserve R",
        "tether that repairs keep in reserve, m; default: as the plan does, at most a tenth of the "
        "limit",
        length,
    ),
    seed("random seed of solvers"),
    RUN_FOLDER,
    *CLEARANCE,
    QUIET,
    JSON,
)

GUARD = Command(
    "watch the tether of a vehicle that somebody else drives",
    "netsp guard problems/wharf.json --link udpin:0.0.0.0:14551 --page",
    Input(
        "SITE",
        "problem file or mission file (JSON); with a planned mission, the guard also says whether "
        "the tether is as planned",
    ),
    Group(
        "input; the guard never commands the vehicle to move",
        (
            LINK,
            Input("--replay LOG", "a recording: .csv, .csv.gz, .tlog or .bin"),
            frame(f"{VEHICLE_FRAMES}; default global where the site has an origin"),
            Option(
                "--system N",
                "the vehicle's system id; default: the first one heard; in a recording, the only "
                "one with positions",
                system_id,
            ),
        ),
    ),
    Group(
        "about the vehicle",
        (
            Option("--noise M", "standard deviation of single positions, m", length, 0.3),
            Option(
                "--drift M", "standard deviation of the slow drift of positions, m", length, 0.5
            ),
            Option("--speed V", "maximum speed of the vehicle, m/s", length, 0.5),
        ),
    ),
    Output(
        "--state FILE", "save the tether's class to this file, and continue from it after a restart"
    ),
    Option(
        "--publish", "send tether, slack and alarms to the link (NAMED_VALUE_FLOAT, STATUSTEXT)"
    ),
    Option(
        "--ask-rates",
        "ask the vehicle to send its position ten times a second (SET_MESSAGE_INTERVAL)",
    ),
    page("serve a page on this computer"),
    Output(
        "-o, --output FILE",
        "write every report as a line of JSON to this file; - is standard output",
    ),
    Option("--quiet", "print neither status line nor alarms"),
)

EXPORT = Command(
    "write a tour as a mission file of a ground station",
    "netsp export solution.json --problem problems/wharf.json --origin 41.18,-8.70 -o wharf.plan",
    Input("SOLUTION", "solution file, or a mission that was planned (JSON)"),
    Input("--problem FILE", "the problem that a solution solves"),
    Option(
        "--format NAME",
        "plan (QGroundControl), wpl (QGC WPL 110), cockpit (Cockpit, .cmp), geojson, kml, kmz or "
        "csv; default: by the extension",
    ),
    Option(
        "--origin LAT,LON[,HEADING]",
        "position of the base, and compass heading of the y axis in degrees; default: the "
        "problem's own origin",
    ),
    Option(
        "--acceptance R",
        "acceptance radius of the vehicle (m), within which it may cut corners",
        length,
        0.0,
    ),
    Option(
        "--hold S",
        "seconds to hold at every goal; default 5, for a mission what its waypoints ask for",
        natural,
    ),
    Option("--speed V", "cruise speed, m/s; default 0.5, for a mission its own", length),
    Option("--max-waypoints N", "maximum number of waypoints", positive, 650),
    Option(
        "--fence-bytes N",
        "storage of the vehicle for its fence, bytes; default 672, that of Pixhawk flight "
        "controllers without an SD card",
        whole_bytes,
        672,
    ),
    Option(
        "--margin SLACK[,CLEARANCE]",
        "warn where less tether is left or an obstacle is closer; default 0.3,0.2",
        default="0.3,0.2",
    ),
    *CLEARANCE,
    Option("--depth D", "depth of all goals of a solution (m), instead of their own", depth),
    Option("--surface Z", "mission: z of the water's surface (m)", float, 0.0),
    Data(
        "-o, --output FILE", "write the mission to this file; - is standard output", required=True
    ),
    JSON,
)

CHARTS = (
    Option(
        "--draught D",
        "areas that may be shallower than this (m), or are not surveyed, become obstacles",
        depth,
    ),
    Output("--floor FILE", "write the sea floor of the chart's depths (.asc, .tif), for scenes"),
    Option("--floor-cell C", "size of the floor's cells (m); default: 256 along a side", length),
)

IMAGES = (
    Option("--resolution R", "size of a cell (m), for an image without a YAML file", length),
    Option(
        "--tolerance T",
        "how far obstacles may go beyond occupied cells (m); default: a cell",
        length,
    ),
    Option("--unknown-free", "treat unknown cells as free, not as obstacles"),
)

IMPORT = Command(
    "make a problem from a map",
    "netsp import examples/site.geojson -o problem.json",
    Input(
        "SITE",
        "map: GeoJSON, KML, KMZ, shapefile, GeoPackage, DXF, S-57, GPX, .plan or .waypoints; or an "
        "occupancy image: YAML, PNG, PGM (docs/guide/bring-your-site-in.md)",
    ),
    Option(
        "--base LAT,LON[,HEADING]",
        "position of the base, and compass heading of the y axis; in an occupancy image X,Y (m); "
        "default: from the file",
    ),
    Option("--tether L", "tether length (m); default: from the file", length),
    Option("--clearance C", "clearance from obstacles (m); default: from the file, or 0", length),
    Option("--radius R", "radius (m) of point obstacles that have none in the file", length),
    Option(
        "--map OURS=THEIRS",
        "what a layer holds (base, goal, obstacle, bounds, path, ignore=LAYER) or what a property "
        "is called (name, radius, depth, tether_length, clearance, heading=PROPERTY)",
        option,
        repeats=True,
    ),
    Option(
        "--crs SYSTEM",
        "coordinate system of a file that names none, such as EPSG:32632; local for a plane",
    ),
    Option(
        "--units UNIT",
        "unit of lengths and of local coordinates in the file: m, km, cm, mm, ft, us-ft, in, yd, "
        "fathom; default: the unit that the file states, or m",
    ),
    Option(
        "--line-width W",
        "width (m) of open lines that are obstacles and have none in the file",
        length,
    ),
    Option(
        "--join-tolerance T",
        "join lines to an outline where their ends are no farther apart (m); default 0.01",
        length,
    ),
    Option(
        "--crop, --no-crop",
        "leave out obstacles beyond the reach of the tether; default: in charts only",
    ),
    Option("--inspect N", "N goals around every obstacle, at every depth", positive),
    Option(
        "--standoff S", "distance (m) of the goals of --inspect from the obstacle's surface", length
    ),
    Option(
        "--of WORD=VALUE",
        "inspect only these obstacles: layer=NAME, name=NAME (with * and ?), "
        "box=XMIN,YMIN,XMAX,YMAX (m), earth=SOUTH,WEST,NORTH,EAST (degrees); repeat a word for "
        "alternatives, different words must all match",
        option,
        repeats=True,
    ),
    Option("--depths D[,D…]", "depths (m) of the goals of --inspect; default 0", default="0"),
    Option("--depth D", "depth of all goals (m), instead of their own", depth),
    Option(
        "--skip-unreachable", "leave out goals that the tether cannot reach, and say which and why"
    ),
    Input(
        "--goals TABLE",
        "add goals from a CSV file with the columns x, y (m) or lat, lon, and optionally z or "
        "depth, name",
    ),
    Input(
        "--candidates TABLE",
        "places where the base may stand (columns as for --goals); cropping keeps everything "
        "within reach of any of them",
    ),
    Group("charts", CHARTS),
    Group("occupancy images", IMAGES),
    Output("--plot FILE", "draw the problem, with what was left out dashed (png, svg or pdf)"),
    Data("-o, --output FILE", "write the problem to this file (default: stdout)"),
    JSON,
    module="import_site",
)

COMPARE = Command(
    "compare solvers over random worlds; resumes if interrupted",
    "netsp compare examples/study.toml -o rows.jsonl --jobs 2",
    Option("[STUDY]", "study file (TOML); without one, the options below describe the study"),
    Option("-o, --output FILE", "results (JSON lines)", required=True),
    Option("--goals N...", "numbers of goals", positive),
    Option("--tethers L...", "tether lengths", length),
    Option("--solvers NAME...", "solvers to compare"),
    Option("--roadmaps NAME...", "roadmaps to compare; default taut"),
    Option(
        "--worlds N",
        "number of worlds for each number of goals and tether length; default 10",
        positive,
    ),
    Option("--family NAME", "family of random worlds; default icra2017"),
    Option("--seeds N...", "random seeds of the solvers; default 0", natural),
    time_limit("seconds per trial; default 120"),
    Option("--memory-limit GIB", "GiB per trial; default no limit", length),
    Option("--jobs N", "number of worker processes", positive, 1),
    Option("--shard I/N", "run only part I of N; default 1/1", shard, (1, 1)),
    Option("--scheduler ADDRESS", "run on the Dask cluster at tcp://host:port"),
    QUIET,
    JSON,
)

COMPARE_PATH = Command(
    "compare drawn or recorded paths with the planned tour",
    "netsp compare-path problems/wharf.json examples/paths/wharf-systematic-1.csv --html page.html",
    Input(
        "PROBLEM", "problem file (JSON), or a study of paths (.toml), which names problem and paths"
    ),
    Input(
        "[PATH...]",
        "a path: table (.csv; columns x, y[, z] or lon, lat[, depth], and t), GeoJSON, GPX, a "
        "recorded flight (.csv.gz, .tlog, .bin) or a solution",
        dest="paths",
    ),
    Input("--solution FILE", "the planned tour; default: solve the problem now"),
    Option(
        "--radius R",
        "distance at which a goal counts as visited, in the problem's units; default 2 %% of the "
        "problem's size",
        length,
    ),
    Option(
        "--speed V",
        "speed of the tour and of paths without time stamps, in the problem's units per second; "
        "default 0.5",
        length,
    ),
    Option("--noise M", "straighten paths by up to M, the error of their positions", length, 0.0),
    frame(
        "local (the problem's plane) or global (degrees), for recordings and GeoJSON; default "
        "global where the problem has an origin"
    ),
    Option(
        "--system N",
        "the vehicle's system id in a .tlog; default: the only one with positions",
        natural,
    ),
    time_limit("seconds for the tour; default no limit"),
    SEED,
    Output(
        "-o, --output FILE",
        "write a row for the tour and each path: a table (.csv; - is standard output) or JSON",
    ),
    Picture("--plot FILE", "draw paths and tour (png, svg or pdf)"),
    Output("--html FILE", "write a page with pictures and tables"),
    QUIET,
    Option("--json", "print all figures as JSON on stdout"),
)

LIBRARY = Command(
    "list the library of problems, check tours, rank solvers",
    "netsp library rank --solver lns --time-limit 5 --only 'jetty-*' -o rows.jsonl",
    Option(
        "{list,check,proofs,rank}",
        "list the problems with their best known tours; check solutions against them; check the "
        "published proofs; rank solvers",
        dest="action",
    ),
    Option("[FILE...]", "check: solution files (JSON)", dest="files"),
    Option(
        "--folder DIR",
        "folder of the library; default problems/library",
        default="problems/library",
    ),
    Option(
        "--only PATTERN",
        "list, proofs, rank: only problems whose names match; default all",
        default="*",
    ),
    Option("--keep", "check: write better tours, and the bound of --proof, to the records"),
    Input("--proof FILE", "check: proof file of a bound, written by `netsp solve --proof`"),
    Option("--by NAME", "check: name of the finder, for the records", default="a contributor"),
    OneOf(
        (
            Option(
                "--solver NAME",
                "rank: a solver, or a function of a travel graph as module:function",
            ),
            Option(
                "--command CMD",
                "rank: a command with {problem}, {solution} and perhaps {seconds} in it",
            ),
        )
    ),
    Option("--label NAME", "rank: name of the solver in tables; default: as given"),
    time_limit("rank: seconds for each problem", 10.0),
    SEED,
    Option(
        "-o, --output FILE",
        "rank: file of rows; rows that it already holds are ranked and not run again",
    ),
    SILENT,
    Option("--json", "print the answer as JSON on stdout"),
)

COMBINE = Command(
    "join the results of shards of one study",
    "netsp combine part-1.jsonl part-2.jsonl -o rows.jsonl",
    Option("RESULTS...", "results of netsp compare"),
    Option("-o, --output FILE", "file for all rows", required=True),
    JSON,
)

REPORT = Command(
    "write a page about a comparison, a solution or a run",
    "netsp report rows.jsonl -o report.html",
    Input(
        "RESULTS", "rows of `netsp compare`, a solution, a planned mission, or the folder of a run"
    ),
    Input("--problem FILE", "the problem of a solution file"),
    Output("-o, --output FILE", "write the page (HTML) to this file", required=True),
    Option("--figures {svg,png,pdf}", "also save the figures beside the page"),
)

SCHEMA = Command(
    "print the JSON Schema of a file format",
    "netsp schema problem > problem.schema.json",
    Option(
        "{problem,solution,scene,mission,surprises,run-state,scene-surprises,study}",
        "format of a file that netsp reads or writes",
        dest="format",
    ),
)

CITE = Command(
    "print how to cite netsp and the problem that it solves",
    "netsp cite --format bibtex",
    Option("--format {text,bibtex}", "text (default) or entries for BibTeX", default="text"),
)

WARM_UP = Command(
    "compile everything before the first use",
    "netsp warm-up",
    SILENT,
    Option(
        "--list",
        "print all functions and the CPU seconds of compiling each, without the functions that it "
        "calls; - if it was on disk already, or another process compiled it",
    ),
    Option("--jobs N", "processes that compile at the same time (default: 1)", positive, 1),
    Option("--part PART", argparse.SUPPRESS, int, 0, shows_default=False),
    Option("--after COMMAND", argparse.SUPPRESS),
)

COMPLETION = Command(
    "print a completion script for your shell",
    "netsp completion bash > ~/.local/share/bash-completion/completions/netsp",
    Option("{bash,zsh,tcsh}", "shell to generate completion for", dest="shell"),
)

COMMANDS = {
    "plan": {
        "solve": SOLVE,
        "app": APP,
        "cover": COVER,
        "verify": VERIFY,
        "margins": MARGINS,
        "plot": PLOT,
        "animate": ANIMATE,
        "base": BASE,
        "tether": TETHER,
        "gtsp": GTSP,
        "world": WORLD,
    },
    "carry out": {
        "simulate": SIMULATE,
        "execute": EXECUTE,
        "order": ORDER,
        "fly": FLY,
        "guard": GUARD,
    },
    "hand over": {"export": EXPORT, "import": IMPORT},
    "compare": {
        "compare": COMPARE,
        "compare-path": COMPARE_PATH,
        "library": LIBRARY,
        "combine": COMBINE,
        "report": REPORT,
    },
    "tools": {"schema": SCHEMA, "cite": CITE, "warm-up": WARM_UP, "completion": COMPLETION},
}
"""Commands by what they are for, and by name."""
