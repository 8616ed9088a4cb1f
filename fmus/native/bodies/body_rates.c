#include "body_rates.h"

#include <math.h>

#include "body.h"
#include "body/modal/forces.h"
#include "body/modal/stop_motion.h"

static const vi_body_form *const form = &vi_this_body;

/* The derivative of a cosine of the phase. */
VI_RARE static double turned(vi_phase phase, double angular_frequency, int order)
{
    return order == 1 ? -angular_frequency * phase.sine : -angular_frequency * angular_frequency * phase.cosine;
}

/* ---- loads ---- */

VI_RARE static double load_of_mode(const vi_structure *s, int j, int order)
{
    const vi_mode *mode = &s->model->mode[j];
    const vi_phase *further = vi_structure_further(s);
    double load = order == 1 ? s->state->held_rate[j] : 0.0;
    if (order == 2 && vi_structure_degree(s) > 1) {
        load = 2.0 * s->state->higher[0][j];
    }
    load += mode->force * turned(vi_structure_phase(s), mode->angular_frequency, order);
    for (int k = 0; k < vi_mode_sines(mode); ++k) {
        load += mode->further[k].force * turned(further[k], mode->further[k].angular_frequency, order);
    }
    return load;
}

/* The base's acceleration by further sines and signals of these values. */
VI_RARE static double base_further(const vi_body *c, const vi_phase phases[], double signal)
{
    double values[VI_SIGNALS_ROOM];
    for (int k = 0; k < VI_SIGNALS_ROOM; ++k) {
        values[k] = signal;
    }
    return form->base_further((const char *)c - form->place, phases, values);
}

VI_RARE static const char *rate_of_base(const vi_structure *s, const vi_body *c, int order, double *rate)
{
    const double amplitude = form->base_forcing((const char *)c - form->place);
    const vi_phase none[VI_SINES_ROOM] = {{0.0, 0.0, 0.0}}, *further = vi_structure_further(s);
    vi_phase phases[VI_SINES_ROOM];
    *rate = order == 1 ? c->base_acceleration_rate : 0.0;
    *rate += amplitude * turned(vi_structure_phase(s), c->forcing_angular_frequency, order);
    if (form->base_further == NULL) {
        return NULL;
    }
    for (int k = 0; k < vi_structure_sines(s->model); ++k) {
        phases[k] = (vi_phase){0.0, turned(further[k], s->model->sine[k].angular_frequency, order), 0.0};
    }
    const double still = base_further(c, none, 0.0);
    *rate += vi_structure_sines(s->model) > 0 ? base_further(c, phases, 0.0) - still : 0.0;
    return s->loads != NULL && base_further(c, none, 1.0) != still ? "a base that a signal of time moves" : NULL;
}

/* ---- motion ---- */

/* The gain of a pressed contact's force by the motion of its stop and, at order 2, by the bend of a power law. `first` is
 * the change of order 1. */
VI_RARE static double force_of_contact(const vi_structure *s, int k, int order, const vi_variation *first)
{
    const double sign = vi_structure_direction(s, k), depth = -vi_structure_clearance(s, k);
    const vi_contact_force slopes = vi_structure_yield(s, k);
    const vi_press press = vi_structure_stop_press(s, k);
    double force = 0.0;
    if (VI_STOPS_MOVE) {
        const vi_stop_course stop = vi_stop_course_of(s, k);
        force -= sign * slopes.stiffness * (order == 1 ? stop.velocity : stop.acceleration);
        force -= sign * slopes.damping * (order == 1 ? stop.acceleration : stop.jerk);
    }
    if (order == 2 && press.kind == VI_PRESS_POWER && slopes.force > 0.0) {
        const double speed = vi_structure_approach(s, k), n = press.exponent;
        double pull = sign * vi_structure_at_body(s->model, s->model->shape[k], first->velocity);
        pull -= VI_STOPS_MOVE ? sign * vi_stop_course_of(s, k).acceleration : 0.0;
        force += speed * ((n - 1.0) * slopes.stiffness * speed / depth + 2.0 * n * slopes.damping / depth * pull);
    }
    return force;
}

/* Are the equations of a contact those of one at rest on a stop that moves? */
VI_RARE static bool rests_on_moving_stop(const vi_structure *s)
{
    bool rests = false;
    for (int k = 0; k < s->model->contacts && vi_structure_stops_move(s->model); ++k) {
        const int32_t status = s->state->status[k];
        rests |= vi_structure_stop_moves(s->model, k) && (status == VI_CONTACT_TOUCHING || status == VI_CONTACT_HELD);
    }
    return rests;
}

VI_RARE const char *vi_body_rate(void *self, int order, const vi_variation *first, vi_variation *change)
{
    const vi_body *c = vi_body_of(self);
    const vi_structure s = vi_body_parts(vi_body_of(self));
    double acceleration[VI_MODES], force[VI_PORTS];
    if (rests_on_moving_stop(&s)) {
        return "a contact at rest on a stop that moves";
    }
    vi_structure_accelerate(&s, acceleration, force);
    for (int j = 0; j < vi_structure_free_modes(s.model); ++j) {
        change->displacement[j] = order == 1 ? s.state->p[j] : first->velocity[j];
        change->velocity[j] = order == 1 ? acceleration[j] : first->load[j];
        change->load[j] = load_of_mode(&s, j, order);
    }
    for (int k = 0; k < s.model->contacts; ++k) {
        if (s.state->status[k] == VI_CONTACT_YIELDING) {
            change->contact[k] = force_of_contact(&s, k, order, first);
        }
    }
    return rate_of_base(&s, c, order, &change->base);
}

VI_RARE double vi_body_bend(void *self, uint32_t reference)
{
    const vi_body *c = vi_body_of(self);
    const vi_structure s = vi_body_parts(vi_body_of(self));
    const size_t member = vi_this_description.variables[reference].offset - form->place;
    double acceleration[VI_MODES], force[VI_PORTS], bend = 0.0;
    int only;
    const bool one = vi_body_is_element(member, offsetof(vi_body, modal_energy), sizeof c->modal_energy, &only);
    const bool kinetic = member == offsetof(vi_body, energy_kinetic) || (one && c->record_energies);
    const bool potential = member == offsetof(vi_body, energy_potential) || (one && c->record_energies);
    if (!kinetic && !potential) {
        return 0.0;
    }
    vi_structure_accelerate(&s, acceleration, force);
    for (int j = 0; j < vi_structure_free_modes(&c->model); ++j) {
        const double stiffness = c->natural[j] * fabs(c->natural[j]);
        if (!one || j == only) {
            bend += kinetic ? acceleration[j] * acceleration[j] : 0.0;
            bend += potential ? stiffness * c->state.p[j] * c->state.p[j] : 0.0;
        }
    }
    return bend;
}
