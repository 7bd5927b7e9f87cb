# Drained triaxial test on a periodic packing of spheres:  yade -n -x -j1 stock.py
import json, sys
from yade import pack

request = json.load(sys.stdin)
p, s = request['parameters'], request['settings']
young, friction_angle = p['young_modulus'], p['friction_angle']
on = request['effects']
roll = p['rolling.friction'] if 'rolling' in on else 0
twist = p['twisting.friction'] if 'twisting' in on else 0
bond = p['cohesion.strength'] if 'cohesion' in on else 0
eased = p['denser_start.eased'] if 'denser_start' in on else 0
order = ['xyz'.index(c) for c in s['axes']]
stiffness_ratio, pressure, packing = s['stiffness_ratio'], s['confining_pressure'], s['packing']
strains = request['control']['values']  # logarithmic, compression positive
lateral_mask, lateral_goal = (0, 0) if s['test'] == 'oedometric' else (3, -pressure)
rate, at_rest, patience = 0.1, 5e-4, 40000  # 1/s; unbalanced force; steps until given up

O.periodic = True
lengths = list(map(float, open(packing).readline().split()[1:]))
O.cell.hSize = Vector3(*[lengths[k] for k in order]).asDiagonal()
material = O.materials.append(CohFrictMat(
    young=young, poisson=stiffness_ratio, frictionAngle=friction_angle * (1 - eased), density=2650e3,
    isCohesive=bond > 0, normalCohesion=bond, shearCohesion=bond, momentRotationLaw=True,
    alphaKr=0.3 if roll > 0 else 0, alphaKtw=0.3 if twist > 0 else 0, etaRoll=roll, etaTwist=twist))
for line in open(packing).readlines()[1:]:
    v = list(map(float, line.split()[:4]))
    O.bodies.append(sphere([v[k] for k in order], v[3], material=material))
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop([Ig2_Sphere_Sphere_ScGeom6D()], [Ip2_CohFrictMat_CohFrictMat_CohFrictPhys(label='contacts')],
                    [Law2_ScGeom6D_CohFrictPhys_CohesionMoment(
                        always_use_moment_law=True, useIncrementalForm=True)]),
    GlobalStiffnessTimeStepper(timestepSafetyCoefficient=0.8),
    PeriTriaxController(label='triax', dynCell=True, maxUnbalanced=at_rest, relStressTol=1e-3),
    NewtonIntegrator(label='newton')]
O.dt = 1e-6


def reach(mask, goal, rates, moving):
    """Move for some steps with little damping, then with much until the goal is met at rest."""
    triax.stressMask, triax.goal, triax.maxStrainRate = mask, goal, rates
    newton.damping, triax.doneHook = 0.2, ''
    if moving > 0:
        O.run(moving, True)
    newton.damping, triax.doneHook = 0.9, 'O.stopAtIter = O.iter + 1'  # pause() ends mid-step
    start = O.iter
    O.run(patience, True)
    if O.iter - start >= patience:
        print('no equilibrium after', patience, 'steps at strain', triax.strain, file=sys.stderr)
        sys.exit(3)


reach(7, (-pressure, -pressure, -pressure), (1, 1, 1), 0)
O.cell.trsf = Matrix3.Identity  # strains start here
if eased > 0:
    O.materials[material].frictionAngle = friction_angle
    for contact in O.interactions:
        contact.phys.tangensOfFrictionAngle = tan(friction_angle)
if bond > 0:
    contacts.setCohesionNow = True
print('axial_strain volumetric_strain axial_stress lateral_stress void_ratio')
for step, strain in enumerate(strains):
    moving = int(abs(strain + triax.strain[2]) / (rate * O.dt))
    reach(lateral_mask, (lateral_goal, lateral_goal, -strain), (1, 1, rate), moving)
    stress = -getStress().diagonal()
    lateral = (stress[0] + stress[1]) / 2
    void_ratio = porosity() / (1 - porosity())
    print(json.dumps({'load_step': step, 'axial_strain': -triax.strain[2],
                      'volumetric_strain': -sum(triax.strain), 'stress_ratio': stress[2] / lateral,
                      'axial_stress': stress[2], 'lateral_stress': lateral,
                      'void_ratio': void_ratio}), flush=True)
