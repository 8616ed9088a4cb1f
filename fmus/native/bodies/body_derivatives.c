#include "body_derivatives.h"

#include <float.h>
#include <math.h>

#include "body.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body_rates.h"
#include "contact/complementarity.h"

static const vi_body_form *const form = &vi_this_body;

/* ---- the equations of the instant ---- */

/* Contacts that are pressed now, with the slopes of their forces, or held. */
typedef struct {
    int held[VI_PORTS], pressed[VI_PORTS], any_held;
    double stiffness[VI_PORTS], damping[VI_PORTS];
    double g[VI_PORTS][VI_PORTS]; /* of the held contacts */
} contact_slopes;

/* Slopes of a force that is pressed now. A contact that begins has depth 0: then they are the limits from inside. */
static vi_contact_force slopes_of(const vi_structure *s, int k)
{
    const vi_press press = vi_structure_stop_press(s, k);
    const vi_law *law = vi_law_of(s->contacts[k].law.law);
    if (press.kind == VI_PRESS_POWER && vi_structure_clearance(s, k) == 0.0) {
        return vi_law_force(law, &press, DBL_MIN, vi_structure_approach(s, k));
    }
    const vi_contact_force force = vi_structure_yield(s, k);
    const bool ended = !s->state->exchange.on && force.force <= 0.0 && vi_structure_clearance(s, k) != 0.0;
    return ended ? (vi_contact_force){0.0, 0.0, 0.0} : force;
}

static void find_slopes(const vi_structure *s, contact_slopes *slopes)
{
    slopes->any_held = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        slopes->held[k] = s->state->status[k] == VI_CONTACT_HELD;
        slopes->pressed[k] = s->state->status[k] == VI_CONTACT_YIELDING;
        slopes->any_held |= slopes->held[k];
        if (slopes->pressed[k]) {
            const vi_contact_force force = slopes_of(s, k);
            slopes->stiffness[k] = force.stiffness;
            slopes->damping[k] = force.damping;
        }
    }
    if (slopes->any_held) {
        vi_structure_signed(s, s->model->compliance, slopes->g);
    }
}

/* Add a multiple of the shape of contact k to a row of the modes that forces move. */
static void add_shape(const vi_structure *s, int k, double factor, double row[])
{
    for (int j = 0; j < vi_structure_free_modes(s->model) && factor != 0.0; ++j) {
        row[j] += factor * s->model->shape[k][j];
    }
}

static double at_contact(const vi_structure *s, int k, const double row[])
{
    return vi_structure_direction(s, k) * vi_structure_at_body(s->model, s->model->shape[k], row);
}

static void carry(void *self, vi_variation *change)
{
    const vi_structure s = vi_body_parts(vi_body_of(self));
    const vi_structure_model *model = s.model;
    double b[VI_PORTS] = {0.0}, hold[VI_PORTS];
    contact_slopes slopes;
    find_slopes(&s, &slopes);
    for (int j = 0; j < vi_structure_free_modes(model); ++j) {
        const double drag = model->coupled ? vi_structure_at_body(model, model->coupling[j], change->velocity)
                                           : 2.0 * model->mode[j].decay * change->velocity[j];
        change->load[j] -= model->mode[j].stiffness * change->displacement[j] + drag;
    }
    for (int k = 0; k < model->contacts; ++k) {
        change->contact[k] = !slopes.pressed[k] ? 0.0
                             : change->contact[k] + slopes.stiffness[k] * at_contact(&s, k, change->displacement)
                                   + slopes.damping[k] * at_contact(&s, k, change->velocity);
        add_shape(&s, k, -vi_structure_direction(&s, k) * change->contact[k], change->load);
    }
    if (!slopes.any_held) {
        return;
    }
    for (int k = 0; k < model->contacts; ++k) {
        b[k] = at_contact(&s, k, change->load);
    }
    vi_solve_active(model->contacts, slopes.g, b, slopes.held, hold);
    for (int k = 0; k < model->contacts; ++k) {
        change->contact[k] += hold[k];
        add_shape(&s, k, -vi_structure_direction(&s, k) * hold[k], change->load);
    }
}

/* Carry the held contacts back: their matrix is symmetric. */
static void hold_back(const vi_structure *s, contact_slopes *slopes, vi_variation *change)
{
    double b[VI_PORTS] = {0.0}, hold[VI_PORTS];
    for (int k = 0; k < s->model->contacts; ++k) {
        b[k] = change->contact[k] - at_contact(s, k, change->load);
    }
    vi_solve_active(s->model->contacts, slopes->g, b, slopes->held, hold);
    for (int k = 0; k < s->model->contacts; ++k) {
        add_shape(s, k, vi_structure_direction(s, k) * hold[k], change->load);
    }
}

static void carry_back(void *self, vi_variation *change)
{
    const vi_structure s = vi_body_parts(vi_body_of(self));
    const vi_structure_model *model = s.model;
    contact_slopes slopes;
    find_slopes(&s, &slopes);
    if (slopes.any_held) {
        hold_back(&s, &slopes, change);
    }
    for (int k = 0; k < model->contacts; ++k) {
        const double sign = vi_structure_direction(&s, k);
        change->contact[k] = slopes.pressed[k] ? change->contact[k] - at_contact(&s, k, change->load) : 0.0;
        add_shape(&s, k, sign * slopes.stiffness[k] * change->contact[k], change->displacement);
        add_shape(&s, k, sign * slopes.damping[k] * change->contact[k], change->velocity);
    }
    for (int j = 0; j < vi_structure_free_modes(model); ++j) {
        change->displacement[j] -= model->mode[j].stiffness * change->load[j];
        for (int i = 0; i < vi_structure_free_modes(model) && model->coupled; ++i) {
            change->velocity[j] -= model->coupling[i][j] * change->load[i];
        }
        change->velocity[j] -= model->coupled ? 0.0 : 2.0 * model->mode[j].decay * change->load[j];
    }
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

bool vi_body_is_element(size_t offset, size_t place, size_t size, int *index)
{
    *index = (int)((offset - place) / sizeof(double)); /* a large offset for places before the array */
    return offset - place < size;
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
        return vi_body_line_of_mode(c, line, j, body.scale);
    }
    vi_body_line_of_shape(c, line, body.shape[j]);
    *factor = body.mass[j];
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
    double acceleration[VI_MODES], force[VI_PORTS];
    vi_structure_accelerate(s, acceleration, force);
    line->port = k;
    line->force = force[k] >= 0.0 ? 1.0 : 0.0;
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
        return vi_body_line_of_mode(c, line, j, 1.0);
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
