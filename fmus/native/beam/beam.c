#include "beam.h"

#include <math.h>
#include <string.h>

#include "beam_check.h"
#include "beam_variables.h"
#include "modes/beam_modes.h"

enum { START_MODES = 4 }; /* default number of modes */

/* Estimated relative error of a natural frequency above which the beam warns. equations.md 6.7 */
static const double VALIDITY_LIMIT = 0.02;
/* Shear coefficient of a rectangular section. */
static const double SHEAR_COEFFICIENT = 5.0 / 6.0;
/* Contact mass of a point, in beam masses, above which the point is a support and can meet no stop. */
static const double HEAVIEST_POINT = 1e20;

static void defaults(void *self)
{
    beam *b = self;
    b->modes = START_MODES;
    b->modes_described = VI_MODES;
    b->boundary = VI_CLAMPED_FREE;
    b->length = 0.25; /* a strip of aluminium */
    b->width = 0.02;
    b->thickness = 0.002;
    b->youngs_modulus = 70e9;
    b->density = 2700.0;
    b->poisson_ratio = 0.3;
    b->forcing_kind = FORCED_AT_POINT;
    b->forcing_mode = 1;
    b->forcing_location = b->sensor_location = 1.0;
    b->impact_projection = PROJECTION_VARIATIONAL;
    for (int k = 0; k < VI_PORTS; ++k) {
        b->contact_location[k] = 1.0;
    }
    for (int k = 0; k < BEAM_SENSORS; ++k) {
        b->sensor[k].location = 1.0;
    }
}

static void sized(void *self, const char *block, int count)
{
    beam *b = self;
    if (strcmp(block, "modes") == 0 && count >= 1 && count <= VI_MODES) {
        b->modes = b->modes_described = count;
    }
}

/* ---- from parameters to modes ---- */

/* Can a stop act at contact k? Law `pair` counts: the importer says only later how a pair acts. */
static bool has_stop(const beam *b, int k)
{
    return !vi_contact_law_is_none(b->body.contacts[k].law.law);
}

static double rigidity(const beam *b)
{
    const double area_moment = b->width * b->thickness * b->thickness * b->thickness / 12.0;
    return b->flexural_rigidity > 0.0 ? b->flexural_rigidity : b->youngs_modulus * area_moment;
}

static double linear_density(const beam *b)
{
    return b->mass_per_length > 0.0 ? b->mass_per_length : b->density * b->width * b->thickness;
}

/* Number of natural modes; residual vectors come after them. */
static int natural_modes(const beam *b)
{
    return (int)b->modes - b->dropped.points;
}

static double eigenvalue_of(const beam *b, int j)
{
    const int natural = natural_modes(b);
    return j < natural ? vi_beam_eigenvalue((vi_beam_boundary)b->boundary, j + 1) : b->dropped.eigenvalue[j - natural];
}

static double participation_of(const beam *b, int j)
{
    const int natural = natural_modes(b);
    return j < natural ? vi_beam_participation((vi_beam_boundary)b->boundary, j + 1)
                       : vi_beam_residual_participation(&b->dropped, j - natural);
}

/* Mass-normalised shape of a point: phi / sqrt(beam mass). equations.md 6.1 */
static void find_shape(const beam *b, double location, double shape[VI_MODES])
{
    const int natural = natural_modes(b);
    for (int j = 0; j < b->modes; ++j) {
        const double phi = j < natural ? vi_beam_shape((vi_beam_boundary)b->boundary, j + 1, location, 0)
                                       : vi_beam_residual_shape(&b->dropped, j - natural, location);
        shape[j] = phi / b->root_mass;
    }
}

static int place_of(double location, int places, const double place[])
{
    for (int i = 0; i < places; ++i) {
        if (place[i] == location) {
            return i;
        }
    }
    return places;
}

static bool on_support(const beam *b, double location)
{
    return (location == 0.0) || (location == 1.0 && b->boundary != VI_CLAMPED_FREE);
}

/* Find one residual vector for each place with a stop. */
static void find_residual(beam *b, char *message)
{
    double place[VI_PORTS];
    int stop[VI_PORTS], places = 0;
    memset(&b->dropped, 0, sizeof b->dropped);
    for (int k = 0; b->residual && k < VI_PORTS; ++k) {
        const double location = b->contact_location[k];
        if (has_stop(b, k) && !on_support(b, location) && place_of(location, places, place) == places) {
            stop[places] = k + 1;
            place[places++] = location;
        }
    }
    if (places == 0) {
        return;
    }
    if (b->modes <= places) {
        vi_complain(message, "modes: expected more than %d beside residual, one for each place that has a stop and at"
                             " least one natural mode, got %lld", places, (long long)b->modes);
        return;
    }
    const int near = vi_beam_residual_find(&b->dropped, (vi_beam_boundary)b->boundary, (int)b->modes - places, places,
                                           place);
    if (near != 0) {
        vi_complain(message, "contact[%d].location: expected a place that residual can tell from those of the other"
                             " stops and from a support, got %.17g", stop[near - 1], place[near - 1]);
    } else if (b->forcing_kind == FORCED_AS_MODE && b->forcing_mode > natural_modes(b)) {
        vi_complain(message, "forcing.mode: expected 1 to %d, a natural mode, got %lld: those after it are residual"
                             " vectors", natural_modes(b), (long long)b->forcing_mode);
    }
}

/* Force on mode j, N kg^(-1/2). equations.md 6.5 */
static double force_on_mode(const beam *b, int j, double amplitude)
{
    switch (b->forcing_kind) {
    case FORCED_AT_POINT: return amplitude * b->forced_shape[j];
    case FORCED_EVENLY: return amplitude * b->length * b->participation[j] / (b->root_mass * b->root_mass);
    case FORCED_AS_MODE: return j + 1 == b->forcing_mode ? amplitude / b->root_mass : 0.0;
    default: return -amplitude * b->participation[j];
    }
}

/* Amplitude of the harmonic modal force on mode j, N kg^(-1/2); a force of frequency 0 is constant. */
static double modal_amplitude(const beam *b, int j)
{
    const double share = b->body.forcing_angular_frequency == 0.0 ? cos(b->body.forcing_phase) : 1.0;
    return share * force_on_mode(b, j, b->forcing_amplitude);
}

static double mode_damping(const beam *b, int j, double natural)
{
    return b->damping_ratio[j] + 0.5 * (b->rayleigh_mass / natural + b->rayleigh_stiffness * natural);
}

/* Grid s_k = k / N, or k / (N + 1) where the far end cannot move; its nearest point is moved to `location`. Returns its
 * index. equations.md 6.8 */
static int find_grid(const beam *b, double location, double s[VI_MODES])
{
    const int n = (int)b->modes;
    const int parts = b->boundary == VI_CLAMPED_FREE ? n : n + 1;
    int nearest = 0;
    for (int k = 0; k < n; ++k) {
        s[k] = (double)(k + 1) / parts;
        nearest = fabs(s[k] - location) < fabs(s[nearest] - location) ? k : nearest;
    }
    s[nearest] = location;
    return nearest;
}

/* Find the modal velocities after a unit impulse at contact k by collocation. The contact point gets the velocity of
 * the variational rule, the other points of the grid get none. False for a singular grid. */
static bool collocate(beam *b, int k)
{
    vi_structure_model *model = &b->body.model;
    double s[VI_MODES], direction[VI_MODES];
    const int at = find_grid(b, b->contact_location[k], s);
    if (!vi_beam_collocation((vi_beam_boundary)b->boundary, model->modes, s, at, direction)) {
        return false;
    }
    const double mobility = vi_structure_at(model, model->shape[k], model->shape[k]);
    for (int j = 0; j < model->modes; ++j) {
        model->impulse[k][j] = b->root_mass * direction[j] * mobility;
    }
    return true;
}

static void place_contact(beam *b, int k, char *message)
{
    vi_structure_model *model = &b->body.model;
    const double location = b->contact_location[k];
    find_shape(b, location, model->shape[k]);
    memcpy(model->impulse[k], model->shape[k], sizeof model->impulse[k]);
    if (vi_contact_law_is_none(b->body.contacts[k].law.law)) {
        return;
    }
    const double mobility = vi_structure_at(model, model->shape[k], model->shape[k]);
    if (!(mobility * b->root_mass * b->root_mass * HEAVIEST_POINT > 1.0)) {
        vi_complain(message, "contact[%d].location: expected a point that can move, got %.17g, a support", k + 1,
                    location);
    } else if (b->impact_projection == PROJECTION_COLLOCATION && !collocate(b, k)) {
        vi_complain(message, "contact[%d].location: expected a point that makes a grid for impact_projection"
                             " collocation, got %.17g, for which the grid is singular", k + 1, location);
    }
}

static void set_mode(beam *b, int j, double natural, double ratio)
{
    vi_structure_mode(&b->body.model, j, natural, ratio, modal_amplitude(b, j), b->body.forcing_angular_frequency);
}

/* Adapt the modes to their amplitudes, if any mode depends on its amplitude. */
static void follow_amplitudes(void *self)
{
    beam *b = self;
    if (!b->depends_on_amplitude) {
        return;
    }
    for (int j = 0; j < b->modes; ++j) {
        const double natural = b->body.natural[j];
        const double a = vi_amplitude_of(b->body.state.q[j], b->body.state.p[j], natural) / b->root_mass;
        const double now = vi_amplitude_natural(&b->amplitude[j], natural, a);
        const double ratio = vi_amplitude_ratio(&b->amplitude[j], mode_damping(b, j, natural), a);
        /* the ratio refers to the frequency of small motion: a changed stiffness keeps the damping */
        set_mode(b, j, now, ratio * natural / now);
    }
    vi_structure_prepare(&b->body.model);
}

static void fill_modes(beam *b)
{
    const double length = b->length;
    const double rate = sqrt(rigidity(b) / linear_density(b)) / (length * length);
    memset(b->body.natural, 0, sizeof b->body.natural);
    b->depends_on_amplitude = 0;
    for (int j = 0; j < b->modes; ++j) {
        const double eigenvalue = eigenvalue_of(b, j);
        const double natural = eigenvalue * eigenvalue * rate;
        b->body.natural[j] = natural;
        b->participation[j] = b->root_mass * participation_of(b, j);
        set_mode(b, j, natural, mode_damping(b, j, natural));
        b->depends_on_amplitude |= vi_amplitude_acts(&b->amplitude[j]);
        b->body.state.q[j] = b->root_mass * b->modal_displacement_start[j];
        b->body.state.p[j] = b->root_mass * b->modal_velocity_start[j];
    }
    b->body.model.varies = b->depends_on_amplitude;
}

static bool fill_model(beam *b, char *message)
{
    vi_structure_model *model = &b->body.model;
    b->root_mass = sqrt(linear_density(b) * b->length);
    model->modes = (int32_t)b->modes;
    model->contacts = vi_body_ports(&b->body);
    find_residual(b, message);
    if (message[0] != '\0') {
        return false;
    }
    find_shape(b, b->forcing_location, b->forced_shape);
    find_shape(b, b->sensor_location, model->observed);
    for (int k = 0; k < BEAM_SENSORS; ++k) {
        find_shape(b, b->sensor[k].location, b->sensor[k].shape);
    }
    fill_modes(b);
    if (!(b->body.natural[0] > 0.0 && isfinite(b->body.natural[model->modes - 1]))) {
        vi_complain(message, "length: expected a beam whose natural frequencies are finite numbers > 0, got %.17g and"
                             " %.17g rad/s", b->body.natural[0], b->body.natural[model->modes - 1]);
    }
    for (int k = 0; k < model->contacts; ++k) {
        place_contact(b, k, message);
    }
    return message[0] == '\0';
}

/* Warn of the first mode for which Euler-Bernoulli's theory does not hold. */
static void warn_of_validity(const void *self, char message[VI_MESSAGE_LENGTH])
{
    const beam *b = self;
    if (b->flexural_rigidity > 0.0 && b->mass_per_length > 0.0) {
        return; /* unknown section */
    }
    const double slenderness = b->thickness / sqrt(12.0) / b->length;
    const double e_over_g = 2.0 * (1.0 + b->poisson_ratio);
    for (int j = 1; j <= natural_modes(b); ++j) {
        const double error =
            vi_beam_validity((vi_beam_boundary)b->boundary, j, slenderness, e_over_g, SHEAR_COEFFICIENT);
        if (error > VALIDITY_LIMIT) {
            vi_complain(message, "modes: mode %d leaves the validity of Euler-Bernoulli's theory: its natural frequency"
                                 " comes out %.2g %% too high (limit %.2g %%). Use %s", j, 100.0 * error,
                        100.0 * VALIDITY_LIMIT, j > 1 ? "fewer modes or a thinner beam" : "a thinner beam");
            return;
        }
    }
}

static bool prepare(void *self, char message[VI_MESSAGE_LENGTH])
{
    beam_check(self, message);
    return message[0] == '\0' && fill_model(self, message);
}

/* ---- loads and outputs ---- */

static void find_forcing(const void *self, double force[VI_MODES])
{
    const beam *b = self;
    for (int j = 0; j < b->modes; ++j) {
        force[j] = modal_amplitude(b, j);
    }
}

static void find_inputs(const void *self, double held[VI_MODES], double held_rate[VI_MODES])
{
    const beam *b = self;
    for (int j = 0; j < b->modes; ++j) {
        held[j] = b->force * b->forced_shape[j] - b->body.base_acceleration * b->participation[j];
        held_rate[j] = b->force_rate * b->forced_shape[j] - b->body.base_acceleration_rate * b->participation[j];
    }
}

static double base_forcing(const void *self)
{
    const beam *b = self;
    return b->forcing_kind == FORCED_BY_BASE ? b->forcing_amplitude : 0.0;
}

static void update_outputs(void *self, double base_acceleration)
{
    beam *b = self;
    const vi_body *body = &b->body;
    for (int j = 0; j < b->modes; ++j) {
        b->modal_displacement[j] = body->state.q[j] / b->root_mass;
        b->modal_velocity[j] = body->state.p[j] / b->root_mass;
        b->modal_acceleration[j] = body->modal_acceleration[j] / b->root_mass;
    }
    for (int k = 0; k < BEAM_SENSORS; ++k) {
        beam_sensor *sensor = &b->sensor[k];
        sensor->displacement = vi_structure_at(&body->model, sensor->shape, body->state.q);
        sensor->velocity = vi_structure_at(&body->model, sensor->shape, body->state.p);
        sensor->acceleration = vi_structure_at(&body->model, sensor->shape, body->modal_acceleration) + base_acceleration;
    }
}

/* The states are those of the modes. */
static void show_states(void *self, vi_exchange_body *body)
{
    const beam *b = self;
    body->modes = (int)b->modes_described;
    body->scale = b->root_mass;
    body->refused = b->depends_on_amplitude ? "amplitude" : NULL;
}

/* ---- partial derivatives ---- */

static bool column(void *self, size_t offset, vi_line *line)
{
    const beam *b = self;
    switch (offset) {
    case offsetof(beam, force):
        vi_body_line_of_shape(&b->body, line, b->forced_shape);
        line->load = 1.0;
        return true;
    case offsetof(beam, force_rate): return true;
    case offsetof(beam, body.base_acceleration):
        vi_body_line_of_shape(&b->body, line, b->participation);
        line->load = -1.0;
        return true;
    case offsetof(beam, forcing_amplitude):
        for (int j = 0; j < b->modes; ++j) {
            line->own[j] = force_on_mode(b, j, 1.0);
        }
        vi_body_line_of_shape(&b->body, line, line->own);
        line->load = vi_body_cosine_of_forcing(&b->body);
        line->base = b->forcing_kind == FORCED_BY_BASE ? line->load : 0.0;
        return true;
    default: return false;
    }
}

static bool row_of_sensor(const beam *b, size_t within, vi_line *line)
{
    vi_body_line_of_shape(&b->body, line, b->sensor[within / sizeof(beam_sensor)].shape);
    switch (within % sizeof(beam_sensor)) {
    case offsetof(beam_sensor, displacement): line->displacement = 1.0; return true;
    case offsetof(beam_sensor, velocity): line->velocity = 1.0; return true;
    case offsetof(beam_sensor, acceleration): line->load = line->base = 1.0; return true;
    default: return false;
    }
}

static bool row(void *self, size_t offset, vi_line *line)
{
    const beam *b = self;
    int j;
    if (offset - offsetof(beam, sensor) < sizeof b->sensor) {
        return row_of_sensor(b, offset - offsetof(beam, sensor), line);
    }
    if (vi_body_is_element(offset, offsetof(beam, modal_displacement), sizeof b->modal_displacement, &j)) {
        line->displacement = 1.0;
    } else if (vi_body_is_element(offset, offsetof(beam, modal_velocity), sizeof b->modal_velocity, &j)) {
        line->velocity = 1.0;
    } else if (vi_body_is_element(offset, offsetof(beam, modal_acceleration), sizeof b->modal_acceleration, &j)) {
        line->load = 1.0;
    } else {
        return false;
    }
    return vi_body_line_of_modes(&b->body, line, j, 1.0 / b->root_mass);
}

/* ---- derivatives since the start ---- */

VI_RARE static bool parameter(void *self, size_t offset, vi_parameter *parameter, vi_sensitivity *of)
{
    const beam *b = self;
    int j;
    if (vi_body_is_element(offset, offsetof(beam, modal_displacement_start), sizeof b->modal_displacement_start, &j)) {
        of->q[j] = j < b->modes ? b->root_mass : 0.0;
    } else if (vi_body_is_element(offset, offsetof(beam, modal_velocity_start), sizeof b->modal_velocity_start, &j)) {
        of->p[j] = j < b->modes ? b->root_mass : 0.0;
    } else if (vi_body_is_element(offset, offsetof(beam, damping_ratio), sizeof b->damping_ratio, &j)) {
        parameter->row[j] = j < b->modes ? 1.0 : 0.0;
        parameter->damping = 2.0 * b->body.natural[j];
    } else {
        return offset == offsetof(beam, forcing_amplitude) && vi_body_forcing_slopes(self, offset, parameter);
    }
    return true;
}

const vi_body_form vi_this_body = {
    .place = offsetof(beam, body),
    .restitution = BEAM_CONTACT_APPLIED_RESTITUTION_1,
    .stride = BEAM_CONTACT_APPLIED_RESTITUTION_2 - BEAM_CONTACT_APPLIED_RESTITUTION_1,
    .taken = BEAM_RECORD_TAKEN,
    .start = "modal_displacement_start",
    .defaults = defaults,
    .sized = sized,
    .prepare = prepare,
    .warn = warn_of_validity,
    .check_inputs = beam_check_inputs,
    .check_forcing = beam_check_amplitude,
    .find_forcing = find_forcing,
    .find_inputs = find_inputs,
    .follow_amplitudes = follow_amplitudes,
    .base_forcing = base_forcing,
    .update_outputs = update_outputs,
    .show_states = show_states,
    .column = column,
    .row = row,
    .parameter = parameter,
};
