"""Measurements by the same code on another orientation of the packing, with errors: python3 measure.py FOLDER [EFFECT=PARAMETER=VALUE]"""
import json, random, subprocess, sys
folder, effects = sys.argv[1], sys.argv[2:]
random.seed(5)
for name, pressure in (("tx02", 2e5), ("tx05", 5e5)):
    request = json.load(open("request.json"))
    request["settings"]["confining_pressure"] = pressure
    request["effects"] = [one.split("=")[0] for one in effects]
    request["parameters"] = {"young_modulus": 1.2e8, "friction_angle": 0.45}
    for one in effects:
        effect, parameter, value = one.split("=")
        request["parameters"][f"{effect}.{parameter}"] = float(value)
    run = subprocess.run(["yade", "-n", "-x", "-j1", "model.py"], input=json.dumps(request), text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    with open(f"{folder}/{name}.csv", "w") as table:
        print("axial_strain,stress_ratio,volumetric_strain", file=table)
        for line in run.stdout.splitlines():
            if not line.startswith("{"): continue
            s = json.loads(line)
            print(s["axial_strain"], s["stress_ratio"] * (1 + random.gauss(0, 0.01)), s["volumetric_strain"] + random.gauss(0, 3e-4), sep=",", file=table)
