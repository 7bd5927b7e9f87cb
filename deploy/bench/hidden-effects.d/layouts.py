"""Other tests than those of the rows: four cases of each layout by the whole program as far as the diagnosis, told without a rate.

Effects stand at the second step of their ray in the catalogue, so lambda is not the same in all.
"""
import math

import cases, laboratory, strengths, two_ways

UP = laboratory.up_and_down
DEGREES = math.pi / 180
STRESSES = {'q_over_p': (0.015, 0.01), 'mean_stress': (0.015, 500.0)}
REBOUND = {'normal_restitution': (0.0, 0.01), 'tangential_restitution': (0.0, 0.01), 'contact_duration': (0.01, 1e-7),
           'peak_overlap': (0.01, 1e-7)}
RAYS = {**strengths.RAYS, 'wall_friction': (strengths.Ray('ratio', (0.25, 0.5)),), 'viscous_damping': (strengths.Ray('ratio', (0.05, 0.1)),)}


def cell(test, pressure, last=0.08, back=0.008, noise=None, control='axial_strain', role='calibrate'):
    return laboratory.Test(test, {'confining_pressure': f'{pressure} MPa'}, path=UP(last, 24, back), noise=noise or dict(laboratory.STRAINS_AND_RATIO),
                           control=control, role=role)


def collision(control, path, settings, role='calibrate'):
    return laboratory.Test('collision', {'radius': '5 mm', **settings}, path=tuple(path), noise=REBOUND, control=control, role=role,
                           kind='collision')


def poured(test, control, path, noise):
    return laboratory.Test(test, {}, path=path, noise=noise, control=control, kind='poured')


def shear(pressure, role='calibrate'):
    return cell('simple_shear', pressure, last=0.15, back=0.015, control='shear_strain', role=role,
                noise={'shear_stress_ratio': (0.015, 0.005), 'volumetric_strain': (0.0, 3e-4)})


SOFT = {'priors': {'young_modulus': ('log_uniform', 5e5, 5e6), 'friction_coefficient': ('uniform', 0.1, 0.9)},
        'truth': {'young_modulus': (1e6, 2.5e6), 'friction_coefficient': (0.3, 0.6)}}
LAYOUTS = {
    'oedometric with unloading, and triaxial': (laboratory.Layout({
        'oed': cell('oedometric', 0.1, last=0.04, back=0.004, noise=STRESSES), 'tx': cell('triaxial_drained', 0.2),
        'held': cell('triaxial_drained', 0.4, role='validate')}), ('contact_plasticity', 'rolling_resistance', 'load_cell_error')),
    'undrained': (laboratory.Layout({
        'low': cell('triaxial_undrained', 0.1, noise=STRESSES), 'high': cell('triaxial_undrained', 0.4, noise=STRESSES)}),
        ('rolling_resistance', 'initial_fabric', 'contact_plasticity')),
    'simple shear': (laboratory.Layout({'low': shear(0.1), 'high': shear(0.4)}),
                     ('rolling_resistance', 'adhesion_jkr', 'pressure_dependent_friction')),
    'collisions': (laboratory.Layout({
        'angle': collision('impact_angle', [10 * k * DEGREES for k in range(8)], {'impact_speed': '1 m/s'}),
        'speed': collision('impact_speed', [0.1 * 2 ** (k / 2) for k in range(9)], {'impact_angle': '30 deg'}),
        'held': collision('impact_angle', [(5 + 10 * k) * DEGREES for k in range(7)], {'impact_speed': '2 m/s'}, 'validate')},
        priors={'young_modulus': ('log_uniform', 2e7, 1e9), 'friction_coefficient': ('uniform', 0.05, 1.0)},
        truth={'young_modulus': (1e8, 4e8), 'friction_coefficient': (0.2, 0.6)}, density='2500 kg/m^3',
        fixed={'poisson_ratio': 0.25}), ('contact_plasticity', 'viscous_damping', 'rolling_resistance')),
    'held-out pressure outside the fitted ones': (laboratory.Layout({
        'low': cell('triaxial_drained', 0.1), 'high': cell('triaxial_drained', 0.2),
        'held': cell('triaxial_drained', 0.8, role='validate')}), ('pressure_dependent_friction', 'adhesion_dmt', 'nonspherical_shape')),
    'heap and discharge together': (laboratory.Layout({
        'heap': poured('angle_of_repose', 'repetition', (1, 2), {'angle_of_repose': (0.0, 0.02), 'heap_height': (0.0, 1e-3)}),
        'silo': poured('silo_discharge', 'opening', (0.024, 0.028), {'mass_flow_rate': (0.05, 1e-3)})},
        **SOFT, density='2500 kg/m^3', effects=('viscous_damping',), fixed={'poisson_ratio': 0.25, 'viscous_damping.ratio': 0.3},
        radii='{mean: 2 mm, spread: 0.15}', packings=8, grains=150), ('rolling_resistance', 'wall_friction', 'nonspherical_shape')),
}


class AtCatalogueSteps:
    """In the place of strengths.Strengths: nothing is tuned."""

    def __init__(self, lab, layout):
        self.lab, self.layout = lab, layout

    def tuned(self, effect, turn, wanted, base, shape=None):
        ray = RAYS[effect][0]
        return strengths.values_on(effect, ray, ray.steps[1], self.lab.catalogue()[effect], self.layout.reference), None


def all_cases(commit):
    """[(case, name of the layout)]: of each one without a hidden effect and three with."""
    made = []
    for number, (name, (_, effects)) in enumerate(LAYOUTS.items()):
        for index, hidden in enumerate([(), *[(effect,) for effect in effects]]):
            made.append((cases.Case(f'layout{number}-{index}', f'layout{number}', index, cases.seed_of(commit, f'layout {name}', index),
                                    hidden, (0,) * len(hidden)), name))
    return made


def run(case, name, lab, workers):
    """Record of a case."""
    layout, _ = LAYOUTS[name]
    steps = two_ways.Steps(lab, f'{lab.folder}/cases/{case.name}', workers)
    truth = lab.measure(case, steps.folder, layout, AtCatalogueSteps(lab, layout))
    campaign = steps.answer('run', 'run', lab.file(steps.folder, layout, 'whole'))['campaign']
    found = steps.answer('diagnose', 'diagnose', campaign)
    return two_ways.record_of(case, truth, way='whole', layout=name, diagnose=two_ways.brief(found))
