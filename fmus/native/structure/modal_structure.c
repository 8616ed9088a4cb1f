#include "modal_structure.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "body/modal/stop_motion.h"
#include "structure_derivatives.h"
#include "structure_file.h"
#include "structure_variables.h"

/* Smallest and largest angular frequency of a mode with a spring, rad/s: their squares are normal numbers. */
static const double SLOWEST = 1e-150, FASTEST = 1e150;
/* Difference of two entries of a symmetric matrix that is rounding, as a part of its size. */
static const double MATRIX_ROUNDING = 64.0 * DBL_EPSILON;

static void defaults(void *self)
{
    modal_structure *s = self;
    s->modes = 1;
    s->modes_described = VI_MODES;
    for (int k = 0; k < VI_PORTS; ++k) {
        s->stop[k].first = 1;
    }
    for (int j = 0; j < VI_MODES; ++j) { /* an oscillator of mass 1 and stiffness 1 */
        s->natural[j] = s->body.model.observed[j] = s->forcing[j] = s->force_shape[j] = 1.0;
        s->base[j] = -1.0;
        for (int k = 0; k < VI_PORTS; ++k) {
            s->body.model.shape[k][j] = 1.0;
        }
    }
    for (int k = 0; k < VI_SIGNALS; ++k) {
        s->signals.signal[k].table_start = 1;
    }
}

static void sized(void *self, const char *block, int count)
{
    modal_structure *s = self;
    if (strcmp(block, "modes") == 0 && count >= 1 && count <= VI_MODES) {
        s->modes = s->modes_described = count;
    }
}

/* ---- the file of modes ---- */

static void *open_file(const char *folder, char message[VI_MESSAGE_LENGTH])
{
    return vi_structure_file_open(folder, message);
}

/* Copy `count` numbers and return the place after them. */
static const double *take(const double *from, int count, double to[])
{
    memcpy(to, from, (size_t)count * sizeof *to);
    return from + count;
}

static void attach(void *self, const void *resources)
{
    modal_structure *s = self;
    const vi_structure_file *file = resources;
    if (file == NULL || file->modes == 0) {
        return;
    }
    const int n = file->modes;
    memset(s->body.model.shape, 0, sizeof s->body.model.shape); /* contacts beyond those of the file meet nothing */
    s->modes = s->modes_of_file = n;
    s->coupled = file->coupled;
    const double *next = take(file->numbers, n, s->natural);
    next = take(next, n, s->damping_ratio);
    for (int i = 0; i < n; ++i) {
        next = take(next, n, s->body.model.coupling[i]);
    }
    for (int k = 0; k < file->contacts; ++k) {
        next = take(next, n, s->body.model.shape[k]);
    }
    for (int k = 0; k < VI_SINES; ++k) {
        memset(s->sine_shape[k], 0, sizeof s->sine_shape[k]);
    }
    double *const rows[] = {s->body.model.observed, s->forcing, s->base, s->force_shape, s->displacement_start,
                            s->velocity_start};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; ++i) {
        next = take(next, n, rows[i]);
    }
    for (int k = 0; k < file->sines; ++k) {
        next = take(next, n, s->sine_shape[k]);
    }
    memset(s->signals.force, 0, sizeof s->signals.force);
    for (int k = 0; k < file->signals; ++k) {
        next = take(next, n, s->signals.force[k]);
    }
    next = take(next, file->rows, s->signals.time);
    (void)take(next, file->rows, s->signals.value);
}

/* ---- validation ---- */

static void check_frequencies(const modal_structure *s, char *message)
{
    double before = -HUGE_VAL;
    for (int j = 0; j < s->modes; ++j) {
        const double w = s->natural[j], size = fabs(w);
        if (!(w == 0.0 || (size >= SLOWEST && size <= FASTEST))) {
            vi_complain(message, "mode.angular_frequency[%d]: expected 0, or a size of %g to %g, got %.17g", j + 1, SLOWEST,
                        FASTEST, w);
        } else if (w < before) {
            vi_complain(message, "mode.angular_frequency[%d]: expected at least that of the mode before, %.17g, got"
                                 " %.17g", j + 1, before, w);
        }
        before = w;
    }
}

static void check_matrix(const modal_structure *s, char *message)
{
    double size = 0.0;
    for (int i = 0; i < s->modes; ++i) {
        for (int j = 0; j < s->modes; ++j) {
            if (!isfinite(s->body.model.coupling[i][j])) {
                vi_complain(message, "mode.damping[%d,%d]: expected a finite number, got %.17g", i + 1, j + 1,
                            s->body.model.coupling[i][j]);
                return;
            }
            size = fmax(size, fabs(s->body.model.coupling[i][j]));
        }
    }
    for (int i = 0; i < s->modes; ++i) {
        for (int j = 0; j < i; ++j) {
            const double one = s->body.model.coupling[i][j], other = s->body.model.coupling[j][i];
            if (!(fabs(one - other) <= MATRIX_ROUNDING * size)) {
                vi_complain(message, "mode.damping[%d,%d]: expected that of [%d,%d], %.17g, got %.17g", i + 1, j + 1,
                            j + 1, i + 1, other, one);
                return;
            }
        }
    }
}

/* Shapes of the further observed points lie behind those of the contacts. */
static void check_further_points(const modal_structure *s, char *message)
{
    const int contacts = vi_body_ports(&s->body);
    if (s->further_points < 0 || s->further_points > VI_PORTS - contacts) {
        vi_complain(message, "further_points: expected 0 to %d, of %d points and contacts in all, got %lld",
                    VI_PORTS - contacts, VI_PORTS, (long long)s->further_points);
        return;
    }
    for (int r = contacts; r < contacts + (int)s->further_points; ++r) {
        vi_check_each(message, vi_check_finite, "mode.contact_shape", s->body.model.shape[r], (int)s->modes);
    }
}

static void check_shapes(const modal_structure *s, char *message)
{
    const int n = (int)s->modes;
    for (int k = 0; k < VI_PORTS; ++k) {
        if (vi_contact_law_is_none(s->body.contacts[k].law.law)) {
            continue;
        }
        double mobility = 0.0;
        for (int j = 0; j < n; ++j) {
            mobility += s->body.model.shape[k][j] * s->body.model.shape[k][j];
        }
        if (!isnormal(mobility)) {
            vi_complain(message, "mode.contact_shape[%d,1:%d]: expected the shape of a contact that can move, got one"
                                 " whose mobility is %g 1/kg", k + 1, n, mobility);
        }
    }
    check_further_points(s, message);
    vi_check_each(message, vi_check_finite, "mode.observed_shape", s->body.model.observed, n);
    vi_check_each(message, vi_check_finite, "mode.forcing", s->forcing, n);
    vi_check_each(message, vi_check_finite, "mode.base", s->base, n);
    vi_check_each(message, vi_check_finite, "mode.force", s->force_shape, n);
    for (int k = 0; k < VI_SINES; ++k) {
        vi_check_each(message, vi_check_finite, "mode.sine", s->sine_shape[k], n);
        if (!isfinite(s->sine[k].phase)) {
            vi_complain(message, "sine[%d].phase: expected a finite number, got %.17g", k + 1, s->sine[k].phase);
        }
    }
}

VI_RARE static void check_stop(const modal_structure *s, int k, char *message)
{
    const vi_stop_motion *m = &s->stop[k];
    const double w = m->angular_frequency;
    const bool turns = w >= SLOWEST && w <= FASTEST;
    if (!isfinite(m->velocity) || !isfinite(m->amplitude) || !isfinite(m->phase)) {
        vi_complain(message, "stop[%d]: expected a finite velocity, amplitude and phase, got %.17g, %.17g and %.17g",
                    k + 1, m->velocity, m->amplitude, m->phase);
    }
    if (!turns && (m->amplitude != 0.0 || w != 0.0)) {
        vi_complain(message, "stop[%d].angular_frequency: expected %g to %g with an amplitude, got %.17g", k + 1, SLOWEST,
                    FASTEST, w);
    }
}

static void check_inputs(const void *self, char message[VI_MESSAGE_LENGTH])
{
    const modal_structure *s = self;
    vi_check_finite(message, "force", s->force);
    vi_check_finite(message, "force_rate", s->force_rate);
}

VI_RARE static void check_forcing(const void *self, char message[VI_MESSAGE_LENGTH])
{
    const modal_structure *s = self;
    vi_check_finite(message, "forcing.amplitude", s->forcing_amplitude);
    vi_check_finite(message, "forcing.base_acceleration", s->forcing_base_acceleration);
    for (int k = 0; k < VI_SINES; ++k) {
        const vi_structure_sine *sine = &s->sine[k];
        const double w = sine->angular_frequency;
        if (!isfinite(sine->amplitude)) {
            vi_complain(message, "sine[%d].amplitude: expected a finite number, got %.17g", k + 1, sine->amplitude);
        }
        if (!(w == 0.0 || (w >= SLOWEST && w <= FASTEST))) {
            vi_complain(message, "sine[%d].angular_frequency: expected 0, or %g to %g, got %.17g", k + 1, SLOWEST, FASTEST,
                        w);
        }
        if (s->sines_started && (w > 0.0) != s->turns[k]) {
            vi_complain(message, "sine[%d].angular_frequency: expected %s, as at the start, got %.17g", k + 1,
                        s->turns[k] ? "> 0" : "0", w);
        }
    }
    vi_structure_check_amplitudes(&s->signals, message);
    for (int k = 0; k < VI_PORTS; ++k) {
        check_stop(s, k, message);
    }
}

/* ---- moving stops ---- */

VI_RARE static void check_table(const modal_structure *s, int k, char *message)
{
    const int64_t first = s->stop[k].first, count = s->stop[k].knots;
    if (count == 0) {
        return;
    }
    if (count < 2 || count > VI_TABLE_ROOM || first < 1 || first > VI_TABLE_ROOM + 1 - count) {
        vi_complain(message, "stop[%d].table_count: expected 0, or 2 and more numbers within 1 to %d, got %lld from"
                             " %lld on", k + 1, VI_TABLE_ROOM, (long long)count, (long long)first);
        return;
    }
    for (int64_t i = first - 1; i < first - 1 + count; ++i) {
        if (!isfinite(s->signals.time[i]) || !isfinite(s->signals.value[i])) {
            vi_complain(message, "table.value[%lld]: expected finite numbers, got %.17g at %.17g s", (long long)i + 1,
                        s->signals.value[i], s->signals.time[i]);
            return;
        }
        if (i > first - 1 && !(s->signals.time[i] > s->signals.time[i - 1])) {
            vi_complain(message, "table.time[%lld]: expected more than the time before, %.17g, got %.17g",
                        (long long)i + 1, s->signals.time[i - 1], s->signals.time[i]);
            return;
        }
    }
}

static void find_stops(const void *self, vi_stop_motion motion[VI_PORTS])
{
    const modal_structure *s = self;
    memset(motion, 0, VI_PORTS * sizeof motion[0]);
    for (int k = 0; k < VI_PORTS; ++k) {
        if (vi_contact_law_has_stop(s->body.contacts[k].law.law)) {
            motion[k] = s->stop[k];
            motion[k].first = motion[k].knots > 0 ? motion[k].first - 1 : 0;
            motion[k].angular_frequency = motion[k].amplitude != 0.0 ? motion[k].angular_frequency : 0.0;
            motion[k].phase = motion[k].amplitude != 0.0 ? motion[k].phase : 0.0;
        }
    }
}

static vi_table tables(const void *self)
{
    const modal_structure *s = self;
    return (vi_table){VI_TABLE_ROOM, s->signals.time, s->signals.value, s->stop_bend};
}

static void check_stops(const modal_structure *s, char *message)
{
    vi_stop_motion motion[VI_PORTS];
    for (int k = 0; k < VI_PORTS; ++k) {
        check_stop(s, k, message);
        check_table(s, k, message);
    }
    find_stops(s, motion);
    const int count = vi_stop_motions_count(motion, vi_body_ports(&s->body));
    if (count > VI_MODES - (int)s->modes) {
        vi_complain(message, "modes: expected at most %d beside %d motions of stops, each a mode, got %lld",
                    VI_MODES - count, count, (long long)s->modes);
    }
}

/* Put the motions of stops behind the modes. */
static void prepare_stops(modal_structure *s)
{
    vi_stop_motion motion[VI_PORTS];
    find_stops(s, motion);
    for (int k = 0; k < VI_PORTS; ++k) {
        if (motion[k].knots > 0) {
            const int64_t first = motion[k].first;
            vi_table_bend((int)motion[k].knots, s->signals.time + first, s->signals.value + first, s->stop_bend + first);
        }
    }
    vi_stop_motions_begin(&s->body.model, motion);
}

static bool parameters_are_good(const modal_structure *s, char *message)
{
    if (s->modes < 1 || s->modes > s->modes_described) {
        vi_complain(message, "modes: expected 1 to %lld, got %lld", (long long)s->modes_described, (long long)s->modes);
        return false;
    }
    if (s->modes_of_file > 0 && s->modes > s->modes_of_file) {
        vi_complain(message, "modes: expected at most the %lld modes of resources/structure.bin, got %lld",
                    (long long)s->modes_of_file, (long long)s->modes);
        return false;
    }
    const int n = (int)s->modes;
    check_frequencies(s, message);
    if (s->coupled) {
        check_matrix(s, message);
    } else {
        vi_check_each(message, vi_check_finite, "mode.damping_ratio", s->damping_ratio, n);
    }
    vi_check_not_negative(message, "displacement_limit", s->body.model.displacement_limit);
    check_shapes(s, message);
    check_stops(s, message);
    check_forcing(s, message);
    vi_structure_check_signals(&s->signals, n, message);
    vi_check_each(message, vi_check_finite, "mode.displacement_start", s->displacement_start, n);
    vi_check_each(message, vi_check_finite, "mode.velocity_start", s->velocity_start, n);
    vi_body_check(&s->body, message);
    check_inputs(s, message);
    return message[0] == '\0';
}

/* ---- from parameters to modes ---- */

/* Modal amplitudes of the harmonic force and of the base's inertial force; a force of frequency 0 is constant. */
static void find_forcing(const void *self, double force[VI_MODES])
{
    const modal_structure *s = self;
    const double share = s->body.forcing_angular_frequency == 0.0 ? cos(s->body.forcing_phase) : 1.0;
    for (int j = 0; j < s->modes; ++j) {
        force[j] = share * (s->forcing_amplitude * s->forcing[j] + s->forcing_base_acceleration * s->base[j]);
    }
}

/* Damping ratio of a mode; where the damping couples the modes, from the diagonal. */
static double ratio_of(const modal_structure *s, int j)
{
    if (!s->coupled) {
        return s->damping_ratio[j];
    }
    return s->natural[j] != 0.0 ? 0.5 * s->body.model.coupling[j][j] / fabs(s->natural[j]) : 0.0;
}

/* Further sines with a frequency; those without are constant loads. */
static void drive_further(void *self, bool at_start)
{
    modal_structure *s = self;
    double force[VI_SINES_ROOM][VI_MODES], w[VI_SINES_ROOM], phase[VI_SINES_ROOM];
    int count = 0;
    for (int k = 0; k < VI_SINES; ++k) {
        const vi_structure_sine *sine = &s->sine[k];
        s->turns[k] = sine->angular_frequency > 0.0;
        if (!s->turns[k]) {
            continue;
        }
        for (int j = 0; j < s->modes; ++j) {
            force[count][j] = sine->amplitude * s->sine_shape[k][j];
        }
        w[count] = sine->angular_frequency;
        phase[count++] = sine->phase;
    }
    const vi_structure parts = vi_body_parts(&s->body);
    s->sines_started = 1;
    vi_structure_drive_further(&parts, count, force, w, at_start ? phase : NULL);
}

static bool prepare(void *self, char message[VI_MESSAGE_LENGTH])
{
    modal_structure *s = self;
    s->sines_started = 0;
    if (!parameters_are_good(s, message)) {
        return false;
    }
    vi_structure_model *model = &s->body.model;
    vi_structure_state *state = &s->body.state;
    double force[VI_MODES];
    s->body.signals_key = vi_structure_signals_key(&s->signals);
    find_forcing(s, force);
    model->modes = (int32_t)s->modes;
    model->given_modes = 0;
    model->contacts = vi_body_ports(&s->body);
    s->body.record.further = model->further = (int32_t)s->further_points;
    model->coupled = s->coupled;
    memcpy(model->impulse, model->shape, sizeof model->impulse);
    for (int j = 0; j < VI_MODES; ++j) {
        const bool used = j < model->modes;
        s->body.natural[j] = used ? s->natural[j] : 0.0;
        state->q[j] = used ? s->displacement_start[j] : 0.0;
        state->p[j] = used ? s->velocity_start[j] : 0.0;
    }
    for (int j = 0; j < model->modes; ++j) {
        vi_structure_mode(model, j, s->natural[j], ratio_of(s, j), force[j], s->body.forcing_angular_frequency);
    }
    prepare_stops(s);
    return true;
}

/* ---- loads and outputs ---- */

static void make_signals(void *self, vi_signal_loads *signals)
{
    vi_structure_make_signals(&((const modal_structure *)self)->signals, signals);
}

static void find_inputs(const void *self, double held[VI_MODES], double held_rate[VI_MODES])
{
    const modal_structure *s = self;
    for (int j = 0; j < s->modes; ++j) {
        held[j] = s->force * s->force_shape[j] + s->body.base_acceleration * s->base[j];
        held_rate[j] = s->force_rate * s->force_shape[j] + s->body.base_acceleration_rate * s->base[j];
    }
    for (int k = 0; k < VI_SINES; ++k) {
        const vi_structure_sine *sine = &s->sine[k];
        const double load = sine->angular_frequency == 0.0 ? sine->amplitude * cos(sine->phase) : 0.0;
        for (int j = 0; j < s->modes && load != 0.0; ++j) {
            held[j] += load * s->sine_shape[k][j];
        }
    }
}

static double base_further(const void *self, const vi_phase further[], const double signal_value[])
{
    const modal_structure *s = self;
    double sum = vi_structure_base_of_signals(&s->signals, signal_value);
    int count = 0;
    for (int k = 0; k < VI_SINES; ++k) {
        const vi_structure_sine *sine = &s->sine[k];
        const double cosine = sine->angular_frequency > 0.0 ? further[count++].cosine : cos(sine->phase);
        sum += sine->of_base ? sine->amplitude * cosine : 0.0;
    }
    return sum;
}

static double base_forcing(const void *self)
{
    return ((const modal_structure *)self)->forcing_base_acceleration;
}

/* All outputs are those of the body. */
static void update_outputs(void *self, double base_acceleration)
{
    (void)self;
    (void)base_acceleration;
}

/* The states are those of the modes. */
static void show_states(void *self, vi_exchange_body *body)
{
    body->modes = (int)((const modal_structure *)self)->modes_described;
}

const vi_body_form vi_this_body = {
    .place = offsetof(modal_structure, body),
    .restitution = STRUCTURE_CONTACT_APPLIED_RESTITUTION_1,
    .stride = STRUCTURE_CONTACT_APPLIED_RESTITUTION_2 - STRUCTURE_CONTACT_APPLIED_RESTITUTION_1,
    .taken = STRUCTURE_RECORD_TAKEN,
    .start = "mode.displacement_start",
    .defaults = defaults,
    .sized = sized,
    .open = open_file,
    .attach = attach,
    .close = free,
    .prepare = prepare,
    .check_inputs = check_inputs,
    .check_forcing = check_forcing,
    .find_forcing = find_forcing,
    .find_stops = find_stops,
    .tables = tables,
    .find_inputs = find_inputs,
    .base_forcing = base_forcing,
    .drive_further = drive_further,
    .base_further = base_further,
    .make_signals = make_signals,
    .update_outputs = update_outputs,
    .show_states = show_states,
    .column = vi_structure_column,
    .row = vi_structure_row,
    .parameter = vi_structure_parameter,
};
