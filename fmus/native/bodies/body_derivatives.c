#include "body_derivatives.h"

#include <math.h>

#include "body.h"
#include "body/modal/carry.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body_rates.h"

static const vi_body_form *const form = &vi_this_body;

/* ---- the equations of the instant ---- */

static void carry(void *self, vi_variation *change)
{
    const vi_structure s = vi_body_parts(vi_body_of(self));
    vi_structure_carry(&s, change);
}

static void carry_back(void *self, vi_variation *change)
{
    const vi_structure s = vi_body_parts(vi_body_of(self));
    vi_structure_carry_back(&s, change);
}

/* ---- lines ---- */

void vi_body_line_of_shape(const vi_body *c, vi_line *line, const double shape[])
{
    line->shape = shape;
    line->count = vi_structure_free_modes(&c->model);
}

bool vi_body_line_of_mode(const vi_body *c, vi_line *line, int j, double shape)
{
    line->own[0] = shape;
    line->shape = line->own;
    line->first = j;
    line->count = j < vi_structure_free_modes(&c->model) ? 1 : 0; /* modes beyond those in use stand still */
    return true;
}

/* Elements of an array from element `first` on, `used` of which depend on anything. */
void vi_body_line_is_alike(vi_line *line, int first, int used)
{
    line->alike = VI_ONLY_MODES == 1 ? 0 : VI_MODES - first; /* a single mode is no array */
    line->used = used - first;
}

bool vi_body_line_of_modes(const vi_body *c, vi_line *line, int j, double shape)
{
    vi_body_line_is_alike(line, j, vi_structure_free_modes(&c->model));
    return vi_body_line_of_mode(c, line, j, shape);
}

/* ---- knowns ---- */

/* Place of a state among those of the description. The references of each half mostly have one distance. */
static size_t place_of_state(uint32_t reference)
{
    const vi_description *all = &vi_this_description;
    const size_t most = all->state_count / 2;
    const uint32_t distance = most > 1 ? all->states[1] - all->states[0] : 1;
    for (size_t half = 0; half < all->state_count; half += most) {
        const uint32_t beyond = (reference - all->states[half]) / distance; /* large for references below the first */
        if (beyond < most && all->states[half + beyond] == reference) {
            return half + beyond;
        }
    }
    size_t i = 0;
    while (i + 1 < all->state_count && all->states[i] != reference) {
        ++i;
    }
    return i;
}

/* A state: of a mass or of a mode. */
static bool column_of_state(void *self, vi_body *c, uint32_t reference, vi_line *line)
{
    vi_exchange_body body = {.scale = 1.0};
    const size_t i = place_of_state(reference), most = vi_this_description.state_count / 2;
    const int j = (int)(i % most);
    double *const factor = i < most ? &line->displacement : &line->velocity;
    vi_this_body.show_states(self, &body);
    *factor = 1.0;
    if (body.shape == NULL) {
        return vi_body_line_of_modes(c, line, j, body.scale);
    }
    vi_body_line_of_shape(c, line, body.shape[j]);
    line->weight = &body.mass[j];
    vi_body_line_is_alike(line, j, line->count);
    line->rows = 1;
    line->count = j < line->count ? line->count : 0; /* masses beyond those in use stand still */
    return true;
}

/* The force that another component applies at contact k; its slopes begin at the present state. */
static void column_of_applied_force(vi_body *c, int k, vi_line *line)
{
    const vi_structure s = vi_body_parts(c);
    if (k >= c->model.contacts) {
        return;
    }
    if (c->model.stop[k] == VI_YIELDING_STOP && vi_contact_law_is_external(c->contacts[k].law.law)) {
        line->port = k;
        line->force = 1.0;
        return;
    }
    vi_body_line_of_shape(c, line, c->model.shape[k]);
    line->load = -vi_structure_direction(&s, k);
}

static bool column_of_contact(vi_body *c, int k, size_t member, vi_line *line)
{
    switch (member) {
    case offsetof(vi_contact, applied_force): column_of_applied_force(c, k, line); return true;
    case offsetof(vi_contact, applied_restitution):
    case offsetof(vi_contact, applied_stiffness):
    case offsetof(vi_contact, applied_damping): return true; /* they act from the present state on */
    default: return false;
    }
}

static bool column(void *self, uint32_t reference, vi_line *line)
{
    vi_body *c = vi_body_of(self);
    const vi_variable *variable = &vi_this_description.variables[reference];
    if (variable->access == VI_SET_STATE) {
        return column_of_state(self, c, reference, line);
    }
    if (variable->access != VI_SET_INPUT && variable->access != VI_SET_TUNABLE) {
        return false;
    }
    const size_t contacts = form->place + offsetof(vi_body, contacts);
    if (variable->offset - contacts < sizeof c->contacts) {
        const size_t within = variable->offset - contacts;
        return column_of_contact(c, (int)(within / sizeof(vi_contact)), within % sizeof(vi_contact), line);
    }
    switch (variable->offset - form->place) {
    case offsetof(vi_body, base_acceleration): line->base = 1.0; return form->column(self, variable->offset, line);
    /* a rate acts over a step, and a frequency from the present phase on */
    case offsetof(vi_body, base_acceleration_rate):
    case offsetof(vi_body, forcing_angular_frequency): return true;
    default: return form->column(self, variable->offset, line);
    }
}

/* ---- unknowns ---- */

static bool is_at_rest(const vi_structure *s, int k)
{
    const int32_t status = s->state->status[k];
    return status == VI_CONTACT_HELD || (status == VI_CONTACT_TOUCHING && vi_structure_only_touches(s, k));
}

/* Is the observed displacement that of a stop? */
static bool is_observed_on_stop(vi_body *c)
{
    const vi_structure s = vi_body_parts(c);
    const double displacement = vi_structure_at(&c->model, c->model.observed, c->state.q);
    for (int k = 0; k < c->model.contacts; ++k) {
        if (c->model.at_observed[k] && is_at_rest(&s, k)) {
            return true;
        }
    }
    return vi_structure_within(&s, displacement) != displacement;
}

static bool row_of_force(const vi_structure *s, int k, vi_line *line)
{
    double acceleration[VI_MODES];
    if (!line->forces_known) {
        vi_structure_accelerate(s, acceleration, line->present);
        line->forces_known = 1;
    }
    line->port = k;
    line->force = line->present[k] >= 0.0 ? 1.0 : 0.0;
    return true;
}

static bool row_of_contact(vi_body *c, int k, size_t member, vi_line *line)
{
    const vi_structure s = vi_body_parts(c);
    const bool used = k < c->model.contacts;
    switch (member) {
    case offsetof(vi_contact, displacement):
        vi_body_line_of_shape(c, line, c->model.shape[k]);
        line->displacement = used && !is_at_rest(&s, k) ? 1.0 : 0.0;
        return true;
    case offsetof(vi_contact, velocity):
        vi_body_line_of_shape(c, line, c->model.shape[k]);
        line->velocity = used && s.state->status[k] != VI_CONTACT_HELD ? 1.0 : 0.0;
        return true;
    case offsetof(vi_contact, force): return !used || row_of_force(&s, k, line);
    case offsetof(vi_contact, indicator): return false; /* an event indicator is no unknown in FMI */
    default: return member >= offsetof(vi_contact, mass); /* results of events stay */
    }
}

/* The slope of a mode's elastic energy, which does not follow the amplitude. */
static double elastic_force(const vi_body *c, int j)
{
    return c->natural[j] * fabs(c->natural[j]) * c->state.q[j];
}

static bool row_of_energies(vi_body *c, size_t member, vi_line *line)
{
    int j;
    if (member == offsetof(vi_body, energy_kinetic)) {
        vi_body_line_of_shape(c, line, c->state.p);
        line->velocity = 1.0;
    } else if (member == offsetof(vi_body, energy_potential)) {
        for (j = 0; j < vi_structure_free_modes(&c->model); ++j) {
            line->own[j] = elastic_force(c, j);
        }
        vi_body_line_of_shape(c, line, line->own);
        line->displacement = 1.0;
    } else if (vi_body_is_element(member, offsetof(vi_body, modal_energy), sizeof c->modal_energy, &j)) {
        vi_body_line_of_mode(c, line, j, c->record_energies ? 1.0 : 0.0);
        line->displacement = elastic_force(c, j);
        line->velocity = c->state.p[j];
    } else {
        return false;
    }
    return true;
}

/* Outputs that no known changes at an instant: natural frequencies, work and losses so far, the record. */
static bool is_constant(size_t member)
{
    return member - offsetof(vi_body, natural) < sizeof(double) * VI_MODES
           || member - (offsetof(vi_body, state) + offsetof(vi_structure_state, energies)) < sizeof(vi_energies)
           || member - offsetof(vi_body, record) < sizeof(vi_record);
}

static bool row_of_body(vi_body *c, size_t member, vi_line *line)
{
    int j;
    switch (member) {
    case offsetof(vi_body, displacement):
        vi_body_line_of_shape(c, line, c->model.observed);
        line->displacement = is_observed_on_stop(c) ? 0.0 : 1.0;
        return true;
    case offsetof(vi_body, velocity):
        vi_body_line_of_shape(c, line, c->model.observed);
        line->velocity = 1.0;
        return true;
    case offsetof(vi_body, acceleration):
        vi_body_line_of_shape(c, line, c->model.observed);
        line->load = line->base = 1.0;
        return true;
    default: break;
    }
    if (vi_body_is_element(member, offsetof(vi_body, modal_acceleration), sizeof c->modal_acceleration, &j)) {
        line->load = 1.0;
        return vi_body_line_of_modes(c, line, j, 1.0);
    }
    return row_of_energies(c, member, line) || is_constant(member);
}

static bool row(void *self, uint32_t reference, vi_line *line)
{
    vi_body *c = vi_body_of(self);
    const vi_variable *variable = &vi_this_description.variables[reference];
    const size_t contacts = form->place + offsetof(vi_body, contacts);
    if (variable->access != VI_READ_ONLY && variable->access != VI_SET_STATE) {
        return false;
    }
    if (variable->offset - contacts < sizeof c->contacts) {
        const size_t within = variable->offset - contacts;
        return row_of_contact(c, (int)(within / sizeof(vi_contact)), within % sizeof(vi_contact), line);
    }
    return form->row(self, variable->offset, line) || row_of_body(c, variable->offset - form->place, line);
}

const vi_partial_derivatives vi_body_derivatives = {
    .begin = vi_body_refresh_inputs,
    .column = column,
    .row = row,
    .carry = carry,
    .carry_back = carry_back,
    .rate = vi_body_rate,
    .bend = vi_body_bend,
};
