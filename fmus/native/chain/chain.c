#include "chain.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "chain_variables.h"

enum { START_MASSES = 2 }; /* default number of masses */

static void defaults(void *self)
{
    chain *c = self;
    c->masses = START_MASSES;
    c->masses_described = VI_MODES;
    for (int i = 0; i < VI_MODES; ++i) {
        c->parameter.mass[i] = c->parameter.stiffness[i] = 1.0;
    }
}

static void sized(void *self, const char *block, int count)
{
    chain *c = self;
    if (strcmp(block, "masses") == 0 && count >= 1 && count <= VI_MODES) {
        c->masses = c->masses_described = count;
    }
}

/* ---- validation ---- */

static void check_mass_number(char *message, const char *name, const chain *c, int64_t number)
{
    if (number < 0 || number > c->masses) {
        vi_complain(message, "%s: expected 1 to %lld, or 0 for the last mass, got %lld", name, (long long)c->masses,
                    (long long)number);
    }
}

static void check_inputs(const void *self, char message[VI_MESSAGE_LENGTH])
{
    const chain *c = self;
    vi_check_each(message, vi_check_finite, "force", c->force, (int)c->masses);
    vi_check_each(message, vi_check_finite, "force_rate", c->force_rate, (int)c->masses);
}

static void check_forcing(const void *self, char message[VI_MESSAGE_LENGTH])
{
    const chain *c = self;
    vi_check_each(message, vi_check_finite, "forcing.amplitude", c->forcing_amplitude, (int)c->masses);
    vi_check_finite(message, "forcing.base_acceleration", c->forcing_base_acceleration);
}

static void check_masses(const chain *c, char *message)
{
    const int n = (int)c->masses;
    vi_check_each(message, vi_check_positive, "mass", c->parameter.mass, n);
    vi_check_each(message, vi_check_not_negative, "stiffness", c->parameter.stiffness, n);
    vi_check_each(message, vi_check_not_negative, "damping", c->parameter.damping, n);
    vi_check_not_negative(message, "far_stiffness", c->far_stiffness);
    vi_check_not_negative(message, "far_damping", c->far_damping);
    check_forcing(c, message);
    vi_check_each(message, vi_check_finite, "displacement_start", c->displacement_start, n);
    vi_check_each(message, vi_check_finite, "velocity_start", c->velocity_start, n);
}

static bool parameters_are_good(const chain *c, char *message)
{
    if (c->masses < 1 || c->masses > c->masses_described) {
        vi_complain(message, "masses: expected 1 to %lld, got %lld", (long long)c->masses_described,
                    (long long)c->masses);
        return false;
    }
    if (c->modes < 0 || c->modes > c->masses) {
        vi_complain(message, "modes: expected 1 to %lld, or 0 for all, got %lld", (long long)c->masses,
                    (long long)c->modes);
        return false;
    }
    check_masses(c, message);
    check_mass_number(message, "observed_mass", c, c->observed_mass);
    for (int k = 0; k < VI_PORTS; ++k) {
        if (!vi_contact_law_is_none(c->body.contacts[k].law.law)) {
            char name[32];
            (void)snprintf(name, sizeof name, "contact[%d].mass_number", k + 1);
            check_mass_number(message, name, c, c->contact_mass[k]);
        }
    }
    vi_body_check(&c->body, message);
    check_inputs(c, message);
    return message[0] == '\0';
}

/* ---- from parameters to modes ---- */

/* Index of a mass; the last mass for other numbers, which ports without a law may have. */
static int index_of(const chain *c, int64_t number)
{
    return (int)(number < 1 || number > c->masses ? c->masses : number) - 1;
}

static int modes_of(const chain *c)
{
    return (int)(c->modes == 0 ? c->masses : c->modes);
}

/* Project loads on the masses to modal forces: sums of shape * load over the masses. equations.md 5.2 */
static void project(const chain *c, const double load[VI_MODES], double modal[VI_MODES])
{
    for (int j = 0; j < modes_of(c); ++j) {
        modal[j] = 0.0;
        for (int i = 0; i < c->masses; ++i) {
            modal[j] += c->shape[i][j] * load[i];
        }
    }
}

static bool find_modes(chain *c, vi_chain_modes *modes, char *message)
{
    const int n = (int)c->masses;
    vi_chain parameter = c->parameter;
    parameter.masses = n;
    parameter.stiffness[n] = c->far_stiffness;
    parameter.damping[n] = c->far_damping;
    if (!vi_chain_find_modes(&parameter, modes)) {
        vi_complain(message, "mass, stiffness: expected a chain whose modes are finite numbers, got others");
        return false;
    }
    memcpy(c->shape, modes->shape, sizeof c->shape);
    return true;
}

/* Modal amplitudes of the harmonic force and of the base's inertial force; a force of frequency 0 is constant. */
static void find_forcing(const void *self, double force[VI_MODES])
{
    const chain *c = self;
    double load[VI_MODES];
    const bool constant = c->body.forcing_angular_frequency == 0.0;
    const double share = constant ? cos(c->body.forcing_phase) : 1.0;
    for (int i = 0; i < c->masses; ++i) {
        load[i] = c->forcing_amplitude[i] - c->parameter.mass[i] * c->forcing_base_acceleration;
    }
    project(c, load, force);
    for (int j = 0; j < modes_of(c); ++j) {
        force[j] *= share;
    }
}

static void fill_model(chain *c, const vi_chain_modes *modes)
{
    vi_structure_model *model = &c->body.model;
    double force[VI_MODES];
    find_forcing(c, force);
    model->modes = (int32_t)modes_of(c);
    model->contacts = vi_body_ports(&c->body);
    model->coupled = !modes->classical;
    memset(c->body.natural, 0, sizeof c->body.natural);
    for (int j = 0; j < model->modes; ++j) {
        c->body.natural[j] = modes->natural[j];
        vi_structure_mode(model, j, modes->natural[j], modes->damping_ratio[j], force[j],
                          c->body.forcing_angular_frequency);
        memcpy(model->coupling[j], modes->damping[j], sizeof model->coupling[j]);
    }
    for (int k = 0; k < VI_PORTS; ++k) {
        memcpy(model->shape[k], c->shape[index_of(c, c->contact_mass[k])], sizeof model->shape[k]);
        memcpy(model->impulse[k], model->shape[k], sizeof model->impulse[k]);
    }
    memcpy(model->observed, c->shape[index_of(c, c->observed_mass)], sizeof model->observed);
}

/* q = Psi' M x, the inverse of x = Psi q if all modes are in use; otherwise the part of x in these modes. */
static void start_modes(chain *c)
{
    double displacement[VI_MODES], velocity[VI_MODES];
    for (int i = 0; i < c->masses; ++i) {
        displacement[i] = c->parameter.mass[i] * c->displacement_start[i];
        velocity[i] = c->parameter.mass[i] * c->velocity_start[i];
    }
    project(c, displacement, c->body.state.q);
    project(c, velocity, c->body.state.p);
}

static bool prepare(void *self, char message[VI_MESSAGE_LENGTH])
{
    chain *c = self;
    vi_chain_modes modes;
    if (!parameters_are_good(c, message) || !find_modes(c, &modes, message)) {
        return false;
    }
    fill_model(c, &modes);
    start_modes(c);
    return true;
}

/* ---- loads and outputs ---- */

static void find_inputs(const void *self, double held[VI_MODES], double held_rate[VI_MODES])
{
    const chain *c = self;
    double load[VI_MODES], rate[VI_MODES];
    for (int i = 0; i < c->masses; ++i) {
        load[i] = c->force[i] - c->parameter.mass[i] * c->body.base_acceleration;
        rate[i] = c->force_rate[i] - c->parameter.mass[i] * c->body.base_acceleration_rate;
    }
    project(c, load, held);
    project(c, rate, held_rate);
}

static double base_forcing(const void *self)
{
    return ((const chain *)self)->forcing_base_acceleration;
}

static void update_outputs(void *self, double base_acceleration)
{
    chain *c = self;
    for (int i = 0; i < c->masses; ++i) {
        c->displacement[i] = vi_structure_at(&c->body.model, c->shape[i], c->body.state.q);
        c->velocity[i] = vi_structure_at(&c->body.model, c->shape[i], c->body.state.p);
        c->relative_acceleration[i] = vi_structure_at(&c->body.model, c->shape[i], c->body.modal_acceleration);
        c->acceleration[i] = c->relative_acceleration[i] + base_acceleration;
    }
}

/* The states are those of the masses. */
static void show_states(void *self, vi_exchange_body *body)
{
    chain *c = self;
    body->modes = (int)c->masses_described;
    body->shape = (const double(*)[VI_MODES])c->shape;
    body->mass = c->parameter.mass;
    body->refused = modes_of(c) < c->masses ? "modes" : NULL;
}

/* ---- partial derivatives ---- */

/* The line of a mass; of none beyond the masses in use. */
static void line_of_mass(const chain *c, int i, vi_line *line)
{
    vi_body_line_of_shape(&c->body, line, c->shape[i]);
    line->count = i < c->masses ? line->count : 0;
    vi_body_line_is_alike(line, i, (int)c->masses);
    line->rows = 1;
}

/* The line of an acceleration of the base: its forces on the modes, summed over two masses at a time. */
static void line_of_base(const chain *c, double factor, vi_line *line)
{
    const int masses = (int)c->masses, modes = line->own_known ? 0 : modes_of(c);
    for (int j = 0; j < modes; ++j) {
        line->own[j] = masses % 2 == 1 ? -c->parameter.mass[masses - 1] * c->shape[masses - 1][j] : 0.0;
    }
    for (int i = 0; i + 1 < masses && modes > 0; i += 2) {
        const double mass = c->parameter.mass[i], next = c->parameter.mass[i + 1];
        for (int j = 0; j < modes; ++j) {
            line->own[j] -= mass * c->shape[i][j] + next * c->shape[i + 1][j];
        }
    }
    line->own_known = 1; /* no other known of a Chain has a shape of its own */
    vi_body_line_of_shape(&c->body, line, line->own);
    line->load = factor;
    line->base = factor;
}

static bool column(void *self, size_t offset, vi_line *line)
{
    const chain *c = self;
    int i;
    if (vi_body_is_element(offset, offsetof(chain, force), sizeof c->force, &i)) {
        line_of_mass(c, i, line);
        line->load = 1.0;
    } else if (vi_body_is_element(offset, offsetof(chain, forcing_amplitude), sizeof c->forcing_amplitude, &i)) {
        line_of_mass(c, i, line);
        line->load = vi_body_cosine_of_forcing(&c->body);
    } else if (offset == offsetof(chain, body.base_acceleration)) {
        line_of_base(c, 1.0, line);
    } else if (offset == offsetof(chain, forcing_base_acceleration)) {
        line_of_base(c, vi_body_cosine_of_forcing(&c->body), line);
    } else if (vi_body_is_element(offset, offsetof(chain, force_rate), sizeof c->force_rate, &i)) {
        vi_body_line_is_alike(line, i, 0);
    } else {
        return false;
    }
    return true;
}

static bool row(void *self, size_t offset, vi_line *line)
{
    const chain *c = self;
    int i;
    if (vi_body_is_element(offset, offsetof(chain, displacement), sizeof c->displacement, &i)) {
        line->displacement = 1.0;
    } else if (vi_body_is_element(offset, offsetof(chain, velocity), sizeof c->velocity, &i)) {
        line->velocity = 1.0;
    } else if (vi_body_is_element(offset, offsetof(chain, acceleration), sizeof c->acceleration, &i)) {
        line->load = 1.0;
        line->base = i < c->masses ? 1.0 : 0.0;
    } else if (vi_body_is_element(offset, offsetof(chain, relative_acceleration), sizeof c->relative_acceleration, &i)) {
        line->load = 1.0;
    } else {
        return false;
    }
    line_of_mass(c, i, line);
    return true;
}

/* ---- derivatives since the start ---- */

/* Set the row of a mass, or of the way between mass i and the one before; the ground is before the first. */
VI_RARE static void row_of(const chain *c, int i, bool between, double row[])
{
    for (int j = 0; j < modes_of(c) && i < c->masses; ++j) {
        row[j] = c->shape[i][j] - (between && i > 0 ? c->shape[i - 1][j] : 0.0);
    }
}

/* A mass, spring or dashpot. The modes are those of the parameters now, and have to be all. */
VI_RARE static bool parameter_of_matrices(const chain *c, size_t offset, vi_parameter *parameter)
{
    const int last = (int)c->masses - 1;
    int i;
    if (vi_body_is_element(offset, offsetof(chain, parameter.mass), sizeof c->parameter.mass, &i)) {
        parameter->mass = 1.0;
        row_of(c, i, false, parameter->row);
    } else if (vi_body_is_element(offset, offsetof(chain, parameter.stiffness), sizeof c->parameter.stiffness, &i)) {
        parameter->stiffness = 1.0;
        row_of(c, i, true, parameter->row);
    } else if (vi_body_is_element(offset, offsetof(chain, parameter.damping), sizeof c->parameter.damping, &i)) {
        parameter->damping = 1.0;
        row_of(c, i, true, parameter->row);
    } else if (offset == offsetof(chain, far_stiffness) || offset == offsetof(chain, far_damping)) {
        parameter->stiffness = offset == offsetof(chain, far_stiffness) ? 1.0 : 0.0;
        parameter->damping = 1.0 - parameter->stiffness;
        row_of(c, last, false, parameter->row);
    } else {
        return false;
    }
    return modes_of(c) >= c->masses;
}

VI_RARE static bool parameter(void *self, size_t offset, vi_parameter *parameter, vi_sensitivity *of)
{
    const chain *c = self;
    double load[VI_MODES] = {0.0};
    int i;
    if (vi_body_is_element(offset, offsetof(chain, displacement_start), sizeof c->displacement_start, &i)) {
        load[i] = c->parameter.mass[i];
        project(c, load, of->q);
    } else if (vi_body_is_element(offset, offsetof(chain, velocity_start), sizeof c->velocity_start, &i)) {
        load[i] = c->parameter.mass[i];
        project(c, load, of->p);
    } else if (vi_body_is_element(offset, offsetof(chain, forcing_amplitude), sizeof c->forcing_amplitude, &i)
               || offset == offsetof(chain, forcing_base_acceleration)) {
        return vi_body_forcing_slopes(self, offset, parameter);
    } else {
        return parameter_of_matrices(c, offset, parameter);
    }
    return true;
}

const vi_body_form vi_this_body = {
    .place = offsetof(chain, body),
    .restitution = CHAIN_CONTACT_APPLIED_RESTITUTION_1,
    .stride = CHAIN_CONTACT_APPLIED_RESTITUTION_2 - CHAIN_CONTACT_APPLIED_RESTITUTION_1,
    .taken = CHAIN_RECORD_TAKEN,
    .start = "displacement_start",
    .defaults = defaults,
    .sized = sized,
    .prepare = prepare,
    .check_inputs = check_inputs,
    .check_forcing = check_forcing,
    .find_forcing = find_forcing,
    .find_inputs = find_inputs,
    .base_forcing = base_forcing,
    .update_outputs = update_outputs,
    .show_states = show_states,
    .column = column,
    .row = row,
    .parameter = parameter,
};
