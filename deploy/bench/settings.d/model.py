# deploy/adapters/yade/model.py with Hertz-Mindlin contacts and rolling resistance of a constant stiffness [N m/rad].
import json, sys
from yade import pack

request = json.load(sys.stdin)
p, s = request['parameters'], request['settings']
stiffness, limit = p['rolling_resistance.stiffness'], p['rolling_resistance.friction']
pressure, packing = s['confining_pressure'], s['packing']
strains = request['control']['values']  # logarithmic, compression positive
rate, at_rest, patience = 0.1, 5e-4, 40000  # 1/s; unbalanced force; steps until given up

O.periodic = True
O.cell.hSize = Vector3(*map(float, open(packing).readline().split()[1:])).asDiagonal()
spheres = pack.SpherePack()
spheres.load(packing)
spheres.toSimulation(material=FrictMat(young=p['young_modulus'], poisson=p['poisson_ratio'], frictionAngle=p['friction_angle'],
                                       density=2650e3))
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop([Ig2_Sphere_Sphere_ScGeom()], [Ip2_FrictMat_FrictMat_MindlinPhys(krot=stiffness, eta=limit)],
                    [Law2_ScGeom_MindlinPhys_Mindlin(includeMoment=stiffness > 0)]),
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
print('axial_strain volumetric_strain axial_stress lateral_stress void_ratio')
for step, strain in enumerate(strains):
    moving = int(abs(strain + triax.strain[2]) / (rate * O.dt))
    reach(3, (-pressure, -pressure, -strain), (1, 1, rate), moving)
    stress = -getStress().diagonal()
    lateral = (stress[0] + stress[1]) / 2
    void_ratio = porosity() / (1 - porosity())
    print(json.dumps({'load_step': step, 'axial_strain': -triax.strain[2],
                      'volumetric_strain': -sum(triax.strain), 'stress_ratio': stress[2] / lateral,
                      'axial_stress': stress[2], 'lateral_stress': lateral,
                      'void_ratio': void_ratio}), flush=True)
