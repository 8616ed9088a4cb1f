#include "body/modal/structure/parameter.h"

#include <math.h>
#include <string.h>

#include "body/modal/forces.h"

/* The harmonic force's phase at this instant changes by this. */
VI_RARE static double phase_slope(const vi_structure *s, const vi_parameter *parameter)
{
    return parameter->phase + parameter->frequency * vi_clock_time(&s->model->clock, s->state->now);
}

/* Present acceleration of the base by input and forcing, m/s^2. */
VI_RARE static double base_acceleration(const vi_structure *s)
{
    const vi_sensitivities *all = s->sensitive;
    const double since = vi_clock_elapsed(&s->model->clock, all->base_since, s->state->now);
    return all->base_held + all->base_rate * since + all->base_amplitude * vi_structure_phase(s).cosine;
}

/* Add the part of the matrices to the loads: minus the forces of the changed masses, dashpots and springs. */
VI_RARE static void add_matrices(const vi_structure *s, const vi_parameter *parameter, vi_variation *change)
{
    double acceleration[VI_MODES], force[VI_PORTS], pull = 0.0;
    if (parameter->mass != 0.0) {
        vi_structure_accelerate(s, acceleration, force);
        pull += parameter->mass * (vi_structure_at_body(s->model, parameter->row, acceleration) + base_acceleration(s));
    }
    pull += parameter->damping * vi_structure_at_body(s->model, parameter->row, s->state->p);
    pull += parameter->stiffness * vi_structure_at_body(s->model, parameter->row, s->state->q);
    for (int j = 0; j < vi_structure_free_modes(s->model); ++j) {
        change->load[j] -= parameter->row[j] * pull;
    }
}

/* The slope of a pressed stop's force over its parameter. */
VI_RARE static double force_slope(const vi_structure *s, const vi_parameter *parameter)
{
    const int k = (int)parameter->port;
    const double depth = -vi_structure_clearance(s, k), rate = vi_structure_approach(s, k);
    const vi_press press = vi_structure_stop_press(s, k);
    const vi_contact_force now = vi_structure_yield(s, k);
    const vi_law *law = vi_law_of(s->contacts[k].law.law);
    double slope = -now.stiffness * vi_structure_direction(s, k) * parameter->position;
    if (press.kind == VI_PRESS_LINEAR) {
        return slope + parameter->press_stiffness * depth + (law->damped ? parameter->press_damping * rate : 0.0);
    }
    if (!(now.force > 0.0)) {
        return slope;
    }
    slope += parameter->press_stiffness * now.force / press.stiffness;
    slope += law->damped ? parameter->press_damping * press.stiffness * pow(depth, press.exponent) * rate : 0.0;
    return slope + (law->exponent > 0.0 ? 0.0 : parameter->press_exponent * now.force * log(depth));
}

VI_RARE void vi_parameter_source(const vi_structure *s, const vi_parameter *parameter, vi_variation *change)
{
    const vi_phase phase = vi_structure_phase(s);
    const double turn = phase_slope(s, parameter) * phase.sine;
    for (int j = 0; j < vi_structure_free_modes(s->model); ++j) {
        change->load[j] = parameter->force[j] * phase.cosine - turn * s->model->mode[j].force;
    }
    change->base = parameter->base * phase.cosine;
    change->base -= turn != 0.0 ? turn * s->sensitive->base_amplitude : 0.0;
    if (parameter->mass != 0.0 || parameter->damping != 0.0 || parameter->stiffness != 0.0) {
        add_matrices(s, parameter, change);
    }
    memset(change->contact, 0, sizeof change->contact);
    if (parameter->port >= 0 && s->state->status[parameter->port] == VI_CONTACT_YIELDING) {
        change->contact[parameter->port] = force_slope(s, parameter);
    }
}
