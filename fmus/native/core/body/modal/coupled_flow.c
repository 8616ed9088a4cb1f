#include "body/modal/coupled_flow.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "contact/complementarity.h"
#include "motion/majorant.h"
#include "motion/power_series.h"

/* Length of a segment, in units of 1 / fastest rate. At REACH the first omitted term of any motion is below 1e-17 of
 * the motion, and its largest terms are 12 times the motion. Where the fast modes move little, the first of REACHES
 * serves at which the last terms are below NEGLIGIBLE, relative to the first. Up to the longest the omitted terms are
 * less than half of the last term. */
static const double REACH = 2.5, REACHES[] = {5.0, 4.25, 3.6, 3.0};
static const double NEGLIGIBLE = 1e-18;
/* Last terms of a power law's depth, relative to the depth times the tolerance, above which the segment ends. The law
 * has a singularity at the end of the contact. */
static const double SMALLEST_TERM = 0.01;
/* Coefficient above which a power law's series ends, before a product of two coefficients overflows. In the first
 * instants of a contact coefficient n is of size (rate / penetration)^n. */
static const double LARGEST_COEFFICIENT = 1e140;

/* Functions must be inlined for the compiler to know the numbers of contacts that they are given as constants. */
#define INLINE static inline __attribute__((always_inline))

/* Upper bound of the growth rate of the Taylor coefficients of any motion, rad/s. */
static double fastest_rate(const vi_structure_model *model, const vi_drift_start *start)
{
    double stiffness = 0.0, damping = 0.0, drag = model->coupled ? model->fastest : 0.0;
    for (int k = 0; k < model->contacts; ++k) {
        const vi_press *press = &start->press[k];
        if (press->kind == VI_PRESS_LINEAR) {
            stiffness += fabs(press->stiffness) * model->compliance[k][k];
            damping += fabs(press->damping) * model->compliance[k][k];
        }
    }
    if (stiffness == 0.0 && damping == 0.0) {
        return model->fastest;
    }
    for (int j = 0; j < vi_structure_modes(model) && !model->coupled; ++j) {
        drag = vi_max(drag, 2.0 * fabs(model->mode[j].decay));
    }
    const double decay = 0.5 * (drag + damping);
    return decay + sqrt(decay * decay + model->fastest * model->fastest + stiffness);
}

/* ---- rows of modes ---- */

/* The equation of the modes; rows are filled up with modes that do not move. */
typedef struct {
    int width;                                             /* of the rows, in whole lanes */
    double stiffness[VI_ROW], drag[VI_ROW], force[VI_ROW]; /* drag: 0 where the damping couples the modes */
    double held[2][VI_ROW];                                /* constant load at the start, and its slope */
    int any_more;                                          /* are there other loads than these and the clock's force? */
    double more[VI_ORDER - 1][VI_ROW];                     /* the Taylor coefficients of those */
    double toward[VI_PORTS][VI_ROW];                       /* shapes, towards the stops */
    double pushed[VI_STOPS_MOVE ? VI_PORTS : 1][VI_ROW];   /* of the modes of bodies only, where stops may move */
    int yields[VI_PORTS], yielding;                        /* the contacts that yield, and their number */
    double compliance[VI_PORTS][VI_PORTS];                 /* of each contact to yielding contacts' forces */
    int is_held[VI_PORTS], any_held, any_power;
    double holding[VI_PORTS][VI_PORTS];                    /* of each contact to held contacts' forces */
} equation;

/* The row of modes that a force of contact k moves. */
INLINE const double *pushed(const equation *e, int k)
{
    return VI_STOPS_MOVE ? e->pushed[k] : e->toward[k];
}

static void set_up_contacts(equation *e, const vi_structure_model *model, const vi_drift_start *start)
{
    e->yielding = e->any_held = e->any_power = 0;
    for (int k = 0; k < model->contacts; ++k) {
        const int64_t kind = start->press[k].kind;
        e->is_held[k] = kind == VI_PRESS_HOLD;
        e->any_held |= e->is_held[k];
        e->any_power |= kind == VI_PRESS_POWER;
        if (kind == VI_PRESS_LINEAR || kind == VI_PRESS_POWER) {
            e->yields[e->yielding++] = k;
        }
        for (int j = 0; j < e->width; ++j) {
            e->toward[k][j] = j < vi_structure_modes(model) ? start->sign[k] * model->shape[k][j] : 0.0;
        }
        for (int j = 0; j < e->width && VI_STOPS_MOVE; ++j) {
            e->pushed[k][j] = j < vi_structure_free_modes(model) ? e->toward[k][j] : 0.0;
        }
    }
}

/* Set the coefficients of the further sines, and those of the loads from degree 2 on. */
static void set_up_more(equation *e, const vi_structure_model *model, const vi_drive *drive)
{
    const int sines = vi_structure_sines(model), degree = VI_DEGREE > 1 ? drive->degree : 1;
    e->any_more = sines > 0 || degree > 1;
    if (!e->any_more) {
        return;
    }
    memset(e->more, 0, sizeof e->more);
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        for (int n = 2; n <= degree; ++n) {
            e->more[n][j] = drive->higher[n - 2][j];
        }
        for (int k = 0; k < sines; ++k) {
            const vi_further *sine = &model->mode[j].further[k];
            const double w = sine->angular_frequency;
            double load[2] = {sine->force * drive->further[k].cosine, -sine->force * w * drive->further[k].sine};
            for (int n = 0; n + 2 <= VI_ORDER; ++n) {
                e->more[n][j] += load[n % 2];
                load[n % 2] = -load[n % 2] * w * w / ((double)(n + 1) * (double)(n + 2));
            }
        }
    }
}

static void set_up(equation *e, const vi_structure_model *model, const vi_drift_start *start)
{
    e->width = VI_WHOLE_LANES(vi_structure_modes(model));
    for (int j = 0; j < e->width; ++j) {
        const bool moves = j < vi_structure_modes(model);
        const vi_mode *mode = &model->mode[moves ? j : 0];
        e->stiffness[j] = moves ? mode->stiffness : 0.0;
        e->drag[j] = moves && !model->coupled ? 2.0 * mode->decay : 0.0;
        e->force[j] = moves ? mode->force : 0.0;
        e->held[0][j] = moves ? start->drive.held[j] - mode->stiffness * start->q[j] : 0.0;
        e->held[1][j] = moves ? start->drive.held_rate[j] : 0.0;
    }
    set_up_more(e, model, &start->drive);
    set_up_contacts(e, model, start);
    for (int k = 0; k < model->contacts; ++k) {
        for (int y = 0; y < e->yielding; ++y) {
            e->compliance[k][y] = start->sign[k] * start->sign[e->yields[y]] * model->compliance[k][e->yields[y]];
        }
        for (int l = 0; l < model->contacts && e->any_held; ++l) {
            e->holding[k][l] = start->sign[k] * start->sign[l] * model->compliance[k][l];
        }
    }
}

static void extend_penetrations(vi_drift *drift, const equation *e, int n)
{
    double moved[VI_PORTS];
    vi_rows_dot(drift->model->contacts, e->toward[0], VI_ROW, drift->modal[n], e->width, moved);
    for (int k = 0; k < drift->model->contacts; ++k) {
        drift->penetration[k][n] = e->is_held[k] ? 0.0 : moved[k];
    }
}

/* ---- forces of contacts ---- */

/* Coefficient n of the force of a power law; coefficient n + 1 of d is known. */
static double pressed_by_power(vi_power_series *depth, const vi_press *press, const double d[], int n)
{
    const double power = depth->power, drag = vi_power_series_extend(depth, d[n + 1]);
    return press->stiffness * (power + press->damping * drag);
}

static double pressed_by_line(const vi_press *press, const double d[], int n)
{
    const double rate = (double)(n + 1) * d[n + 1];
    return (n == 0 ? press->constant : 0.0) + press->stiffness * d[n] + press->damping * rate;
}

/* Coefficient n of the forces of the yielding contacts. */
INLINE void press(vi_drift *drift, const equation *e, const vi_drift_start *start, int n, int yielding,
                  vi_power_series power[])
{
    for (int i = 0; i < yielding; ++i) {
        const int k = e->yields[i];
        const vi_press *law = &start->press[k];
        const double *d = drift->penetration[k];
        drift->force[k][n] = law->kind == VI_PRESS_LINEAR ? pressed_by_line(law, d, n)
                                                          : pressed_by_power(&power[k], law, d, n);
    }
}

/* ---- the next coefficient of the motion ---- */

/* Coefficient n of the modes' accelerations by forcing, springs and uncoupled damping. */
INLINE void load_modes(const vi_drift *drift, const equation *restrict e, double drive, int n, double *restrict load)
{
    const double *restrict x = drift->modal[n], *restrict v = drift->modal[n + 1];
    const double order = (double)(n + 1);
    for (int j = 0; j < e->width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            load[j + i] = drive * e->force[j + i] - e->stiffness[j + i] * x[j + i]
                          - order * (e->drag[j + i] * v[j + i]);
        }
    }
}

/* Coefficient n + 2 of the motion, still without the loads of inputs, held contacts and coupling damping. Where none of
 * these act (`apart`), the contacts do not wait for the modes: the compliances give the effect of the forces on them. */
INLINE void extend(vi_drift *drift, const equation *e, double drive, int n, double share, int contacts, int yielding,
                   bool apart)
{
    double load[VI_ROW], loaded[VI_PORTS], *restrict next = drift->modal[n + 2];
    load_modes(drift, e, drive, n, load);
    if (apart) {
        vi_rows_dot(contacts, e->toward[0], VI_ROW, load, e->width, loaded);
    }
    for (int k = 0; k < contacts && apart; ++k) {
        double all = loaded[k];
        for (int y = 0; y < yielding; ++y) {
            all -= e->compliance[k][y] * drift->force[e->yields[y]][n];
        }
        drift->penetration[k][n + 2] = share * all;
    }
    for (int y = 0; y < yielding; ++y) {
        vi_row_add(load, -drift->force[e->yields[y]][n], pushed(e, e->yields[y]), e->width);
    }
    for (int j = 0; j < e->width; j += VI_LANES) {
        for (int i = 0; i < VI_LANES; ++i) {
            next[j + i] = share * load[j + i];
        }
    }
}

/* Add the damping that couples the modes. */
static void drag(vi_drift *drift, int n, double share)
{
    const vi_structure_model *model = drift->model;
    const double order = (double)(n + 1);
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        drift->modal[n + 2][j] -= share * order * vi_structure_at(model, model->coupling[j], drift->modal[n + 1]);
    }
}

/* Add the forces that keep the held contacts at rest: shape_k . q'' = 0 for each of them. */
static void hold(vi_drift *drift, equation *e, int n, double share)
{
    const int contacts = drift->model->contacts;
    double b[VI_PORTS] = {0.0}, f[VI_PORTS], *next = drift->modal[n + 2];
    for (int k = 0; k < contacts; ++k) {
        b[k] = e->is_held[k] ? vi_row_dot(e->toward[k], next, e->width) : 0.0;
    }
    vi_solve_active(contacts, e->holding, b, e->is_held, f);
    for (int k = 0; k < contacts; ++k) {
        if (e->is_held[k]) {
            drift->force[k][n] = f[k] / share;
            vi_row_add(next, -f[k], pushed(e, k), e->width);
        }
    }
}

/* ---- a drift ---- */

/* Sizes of the loads on the modes at the start, N kg^(-1/2). */
static void size_loads(const vi_structure_model *model, const vi_drift_start *start, double size[])
{
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        size[j] = mode->force_size + fabs(start->drive.held[j]) + fabs(mode->stiffness * start->q[j]);
        size[j] += vi_structure_drag_size(model, j, start->p);
    }
}

static void scale_of_holding(vi_drift *drift, const vi_drift_start *start)
{
    const vi_structure_model *model = drift->model;
    double load[VI_MODES], size[VI_PORTS] = {0.0};
    int pushing[VI_PORTS], count = 0; /* the stops with a force */
    size_loads(model, start, load);
    for (int l = 0; l < model->contacts; ++l) {
        pushing[count] = l;
        count += drift->force[l][0] != 0.0;
    }
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        for (int k = 0; k < model->contacts; ++k) {
            double terms = load[j];
            for (int i = 0; i < count; ++i) { /* of yielding and of other holding stops */
                const int l = pushing[i];
                terms += l == k ? 0.0 : fabs(model->shape[l][j] * drift->force[l][0]);
            }
            size[k] += fabs(model->shape[k][j]) * terms;
        }
    }
    for (int k = 0; k < model->contacts; ++k) {
        drift->force_scale[k] = size[k] / fabs(model->mobility[k][k]);
    }
}

/* The largest modulus of a row. */
static double largest(const double row[], int width)
{
    double most = 0.0;
    for (int j = 0; j < width; ++j) {
        most = vi_max(most, fabs(row[j]));
    }
    return most;
}

/* Length of the segment times the fastest rate. */
static double reach(const vi_drift *drift, const equation *e, double fastest)
{
    const double first = largest(drift->modal[1], e->width), second = largest(drift->modal[2], e->width);
    const double last = largest(drift->modal[VI_ORDER], e->width),
                 before = largest(drift->modal[VI_ORDER - 1], e->width);
    for (size_t i = 0; i < sizeof REACHES / sizeof *REACHES; ++i) {
        const double u = REACHES[i] / fastest, u2 = u * u, u4 = u2 * u2, u8 = u4 * u4;
        if (u8 * u8 * u8 * (before + last * u) <= NEGLIGIBLE * vi_max(first, second * u)) {
            return REACHES[i];
        }
    }
    return REACH;
}

/* Shorten the segment to where the terms of order `last` - 1 and `last` are below this size. */
static void shorten_for(vi_drift *drift, const double series[], int last, double size)
{
    for (int n = last - 1; n <= last; ++n) {
        if (series[n] != 0.0) {
            drift->length = vi_min(drift->length, pow(size / fabs(series[n]), 1.0 / (double)n));
        }
    }
}

/* Shorten the segment for power laws, to where their last terms are below the tolerance. Held contacts may bear a force
 * that moves nothing: then only its own series shows its singularity. */
static void shorten(vi_drift *drift, const vi_drift_start *start, bool any_held)
{
    const double share = SMALLEST_TERM * drift->model->tolerance;
    for (int k = 0; k < drift->model->contacts; ++k) {
        const vi_press *press = &start->press[k];
        const double depth = drift->penetration[k][0];
        if (press->kind == VI_PRESS_POWER) {
            shorten_for(drift, drift->penetration[k], drift->order, share * depth);
            if (any_held) {
                const double force = press->stiffness * pow(depth, press->exponent);
                shorten_for(drift, drift->force[k], drift->order - 2, share * force);
            }
        }
    }
}

/* End the series with this order. */
static void end_series(vi_drift *drift, int order)
{
    drift->order = order;
    for (int n = order + 1; n <= VI_ORDER; ++n) {
        memset(drift->modal[n], 0, sizeof drift->modal[n]);
        for (int k = 0; k < drift->model->contacts; ++k) {
            drift->penetration[k][n] = 0.0;
        }
    }
    for (int k = 0; k < drift->model->contacts; ++k) {
        for (int n = order - 1; n <= VI_ORDER; ++n) {
            drift->force[k][n] = 0.0;
        }
    }
}

/* Has a power law's series grown too steep to be continued beyond coefficient n + 2? */
INLINE bool too_steep(const vi_drift *drift, const vi_drift_start *start, int n, int contacts,
                      const vi_power_series power[])
{
    for (int k = 0; k < contacts; ++k) {
        if (start->press[k].kind == VI_PRESS_POWER
            && !(fabs(drift->penetration[k][n + 2]) < LARGEST_COEFFICIENT
                 && fabs(power[k].power) < LARGEST_COEFFICIENT)) {
            return true;
        }
    }
    return false;
}

static void start_series(vi_drift *drift, const equation *e, const vi_drift_start *start, vi_power_series power[])
{
    const vi_structure_model *model = drift->model;
    memset(drift->force, 0, (size_t)model->contacts * sizeof drift->force[0]);
    for (int j = 0; j < e->width; ++j) {
        drift->modal[0][j] = 0.0;
        drift->modal[1][j] = j < vi_structure_modes(model) ? start->p[j] : 0.0;
    }
    extend_penetrations(drift, e, 1);
    for (int k = 0; k < model->contacts; ++k) {
        drift->penetration[k][0] = start->penetration[k];
        if (start->press[k].kind == VI_PRESS_POWER) {
            vi_power_series_begin(&power[k], start->press[k].exponent, start->penetration[k]);
        }
    }
}

/* Find all coefficients of the series. */
INLINE void find_series(vi_drift *drift, equation *e, const vi_drift_start *start, vi_power_series power[],
                        int contacts, int yielding)
{
    const vi_structure_model *model = drift->model;
    const double w = model->clock.angular_frequency;
    const bool any_held = contacts > yielding && e->any_held, apart = !model->coupled && !any_held && !e->any_more;
    double drive[2] = {start->drive.phase.cosine, -w * start->drive.phase.sine};
    for (int n = 0; n + 2 <= VI_ORDER; ++n) {
        const double share = 1.0 / ((double)(n + 1) * (double)(n + 2)), next = -drive[0] * w * w * share;
        press(drift, e, start, n, yielding, power);
        extend(drift, e, drive[0], n, share, contacts, yielding, apart);
        if (n < 2) {
            vi_row_add(drift->modal[n + 2], share, e->held[n], e->width);
        }
        if (e->any_more) {
            vi_row_add(drift->modal[n + 2], share, e->more[n], e->width);
        }
        if (model->coupled) {
            drag(drift, n, share);
        }
        if (any_held) {
            hold(drift, e, n, share);
        }
        if (n < 2 || !apart) {
            extend_penetrations(drift, e, n + 2);
        }
        drive[0] = drive[1];
        drive[1] = next;
        if (e->any_power && too_steep(drift, start, n, contacts, power)) {
            end_series(drift, n + 1);
            break;
        }
    }
}

void vi_drift_begin(vi_drift *drift, const vi_structure_model *model, const vi_drift_start *start, double length)
{
    vi_power_series power[VI_PORTS];
    equation e;
    drift->model = model;
    drift->order = VI_ORDER;
    drift->rooted = 0;
    set_up(&e, model, start);
    start_series(drift, &e, start, power);
    if (model->contacts == 1 && e.yielding == 1) { /* the usual case, with loops of length one */
        find_series(drift, &e, start, power, 1, 1);
    } else {
        find_series(drift, &e, start, power, model->contacts, e.yielding);
    }
    scale_of_holding(drift, start);
    const double fastest = fastest_rate(model, start);
    drift->length = fastest > 0.0 ? vi_min(length, reach(drift, &e, fastest) / fastest) : length;
    shorten(drift, start, e.any_held);
}

void vi_drift_at(const vi_drift *drift, double u, const double q[], double p_end[], double q_end[])
{
    const int modes = vi_structure_modes(drift->model), width = VI_WHOLE_LANES(modes);
    const int least = drift->rooted ? 2 : 0; /* with r^2 = u: x = u y, x' = y + r y' / 2 */
    const double r = vi_drift_variable(drift, u);
    double x[2][VI_LANES], v[2][VI_LANES];
    for (int j = 0; j < width; j += 2 * VI_LANES) { /* two rows of lanes at a time: each row waits for its own sum */
        const int next = j + VI_LANES < width ? j + VI_LANES : j;
        memset(v, 0, sizeof v);
        memcpy(x[0], &drift->modal[VI_ORDER][j], sizeof x[0]);
        memcpy(x[1], &drift->modal[VI_ORDER][next], sizeof x[1]);
        for (int n = VI_ORDER - 1; n >= least; --n) {
            const double *c = &drift->modal[n][j], *d = &drift->modal[n][next];
            for (int i = 0; i < VI_LANES; ++i) {
                v[0][i] = v[0][i] * r + x[0][i];
                x[0][i] = x[0][i] * r + c[i];
            }
            for (int i = 0; i < VI_LANES; ++i) {
                v[1][i] = v[1][i] * r + x[1][i];
                x[1][i] = x[1][i] * r + d[i];
            }
        }
        for (int i = 0; i < 2 * VI_LANES && j + i < modes; ++i) {
            const double sum = x[i / VI_LANES][i % VI_LANES], slope = v[i / VI_LANES][i % VI_LANES];
            q_end[j + i] = q[j + i] + (drift->rooted ? u * sum : sum);
            p_end[j + i] = drift->rooted ? sum + 0.5 * r * slope : slope;
        }
    }
}

double vi_drift_impulse(const vi_drift *drift, int k, double u)
{
    const double r = vi_drift_variable(drift, u), step = drift->rooted ? 2.0 : 1.0;
    double sum = 0.0;
    for (int n = VI_ORDER; n >= 0; --n) {
        sum = sum * r + drift->force[k][n] / ((double)n / step + 1.0);
    }
    return sum * u;
}

void vi_drift_point(const vi_drift *drift, const double shape[], double polynomial[VI_ORDER + 1])
{
    for (int n = 0; n <= VI_ORDER; ++n) {
        polynomial[n] = vi_structure_at(drift->model, shape, drift->modal[n]);
    }
}
