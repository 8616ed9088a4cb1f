#include "lanes/lane_tables.h"

#include <math.h>
#include <stdbool.h>

#include "motion/majorant.h"

/* State (q, p, cosine, sine) after some cells, as rows over (q, p, cosine, sine, 1). */
typedef struct {
    double q[VI_PARTS], p[VI_PARTS];
    double cosine, sine; /* turn of the force */
} step;

/* Taylor terms of q over the share of the cell, for one part of the state, from the equation of motion. */
static void expand(const vi_lane_mode *mode, double cell, int part, int order, double term[])
{
    const double square = cell * cell, turn = mode->angular_frequency * cell, turn_square = turn * turn;
    const double drag = 2.0 * mode->decay * cell, spring = mode->stiffness * square;
    double drive[2] = {0.0, 0.0};
    drive[0] = part == VI_OF_COSINE ? mode->force * square : 0.0;
    drive[1] = part == VI_OF_SINE ? -(mode->force * square) * turn : 0.0;
    term[0] = part == VI_OF_Q ? 1.0 : 0.0;
    term[1] = part == VI_OF_P ? cell : 0.0;
    for (int n = 0; n + 2 <= order; ++n) {
        const double share = 1.0 / ((n + 1.0) * (n + 2.0));
        const double held = n == 0 && part == VI_OF_ONE ? mode->held * square : 0.0;
        term[n + 2] = (((drive[0] + held) - drag * (n + 1.0) * term[n + 1]) - spring * term[n]) * share;
        const double next = -drive[0] * turn_square * share;
        drive[0] = drive[1];
        drive[1] = next;
    }
}

/* Cosine and sine of the force's turn over a cell. */
static void turn_of(double angle, int order, double *cosine, double *sine)
{
    const double square = angle * angle;
    double c = 0.0, s = 0.0;
    for (int n = order; n >= 2; n -= 2) {
        c = (1.0 + c) * (-square / (n * (n - 1.0)));
        s = (1.0 + s) * (-square / (n * (n + 1.0)));
    }
    *cosine = 1.0 + c;
    *sine = angle + angle * s;
}

/* A row over the parts of the state after the step `a`, as a row over the parts before it. */
static void shift(const step *a, const double after[VI_PARTS], double before[VI_PARTS])
{
    for (int part = 0; part < VI_PARTS; ++part) {
        before[part] = after[VI_OF_Q] * a->q[part] + after[VI_OF_P] * a->p[part];
    }
    before[VI_OF_COSINE] += after[VI_OF_COSINE] * a->cosine + after[VI_OF_SINE] * a->sine;
    before[VI_OF_SINE] += after[VI_OF_COSINE] * -a->sine + after[VI_OF_SINE] * a->cosine;
    before[VI_OF_ONE] += after[VI_OF_ONE];
}

/* The step `a`, then the step `b`. */
static step joined(const step *a, const step *b)
{
    step both;
    shift(a, b->q, both.q);
    shift(a, b->p, both.p);
    both.cosine = a->cosine * b->cosine - a->sine * b->sine;
    both.sine = a->sine * b->cosine + a->cosine * b->sine;
    return both;
}

static void store(vi_one_mode *tables, int lane, int cells, const step *s)
{
    for (int part = 0; part < VI_PARTS; ++part) {
        tables->end_q[cells][part][lane] = s->q[part];
        tables->end_p[cells][part][lane] = s->p[part];
    }
    tables->turn_cosine[cells][lane] = s->cosine;
    tables->turn_sine[cells][lane] = s->sine;
}

static step stored(const vi_one_mode *tables, int lane, int cells)
{
    step s;
    for (int part = 0; part < VI_PARTS; ++part) {
        s.q[part] = tables->end_q[cells][part][lane];
        s.p[part] = tables->end_p[cells][part][lane];
    }
    s.cosine = tables->turn_cosine[cells][lane];
    s.sine = tables->turn_sine[cells][lane];
    return s;
}

/* ---- bounds ---- */

/* Bounds of q and p at the ends of some pairs: a number, and factors of |q| and |p| at the start. */
typedef struct {
    double q[3], p[3];
} reach;

/* Bounds of a row at the ends of some pairs. */
static void reach_row(const vi_lane_array rows[][VI_PARTS], int lane, int pairs, double by[3])
{
    double force = 0.0, held = 0.0;
    by[1] = by[2] = 0.0;
    for (int i = 0; i <= 2 * pairs; i += 2) {
        const double c = rows[i][VI_OF_COSINE][lane], s = rows[i][VI_OF_SINE][lane];
        force = vi_max(force, c * c + s * s);
        held = vi_max(held, fabs(rows[i][VI_OF_ONE][lane]));
        by[1] = vi_max(by[1], fabs(rows[i][VI_OF_Q][lane]));
        by[2] = vi_max(by[2], fabs(rows[i][VI_OF_P][lane]));
    }
    by[0] = sqrt(force) + held;
}

/* Bounds over a pair, in units of the pair, from q'' + drag q' + spring q = force cos + held. Inside a pair q exceeds its
 * ends by an eighth of the largest q'', and q' by half of it. `q`, `p`: bounds at the ends; loaded: do loads count? */
static void bound_pair(const vi_lane_mode *mode, double pair, double q, double p, bool loaded, double *third,
                       double *fourth)
{
    const double square = pair * pair, turn = mode->angular_frequency * pair, drag = 2.0 * mode->decay * pair;
    const double spring = mode->stiffness * square, force = fabs(mode->force) * square, held = fabs(mode->held) * square;
    const double stiff = drag * drag - spring; /* q''' = force' - drag force + stiff q' + drag spring q */
    const double room = 1.0 / (1.0 - 0.5 * drag - 0.125 * spring), bend = stiff - turn * turn;
    const double own_third = force * sqrt(turn * turn + drag * drag) + held * drag;
    const double own_fourth = force * sqrt(bend * bend + turn * turn * drag * drag) + held * fabs(stiff);
    const double speed = pair * p, own = drag * speed + spring * q;
    const double second = ((loaded ? force + held : 0.0) + own) * room;
    const double slope = speed + 0.5 * second, size = q + 0.125 * second;
    *third = (loaded ? own_third : 0.0) + (fabs(stiff) * slope + drag * spring * size);
    *fourth = (loaded ? own_fourth : 0.0) + (drag * fabs(spring - stiff) * slope + spring * fabs(stiff) * size);
}

static void bound_pairs(vi_one_mode *tables, int lane, const vi_lane_mode *mode, double pair, int far)
{
    reach ends;
    reach_row(tables->end_q, lane, far ? VI_PAIRS : VI_NEAR_PAIRS, ends.q);
    reach_row(tables->end_p, lane, far ? VI_PAIRS : VI_NEAR_PAIRS, ends.p);
    for (int i = 0; i < 3; ++i) {
        bound_pair(mode, pair, ends.q[i], ends.p[i], i == 0, &tables->third_by[far][i][lane],
                   &tables->fourth_by[far][i][lane]);
    }
}

void vi_lane_pair_tables(vi_one_mode *tables, int lane, const vi_lane_mode *mode, double cell)
{
    const step one = stored(tables, lane, 1), cells = stored(tables, lane, VI_CELLS);
    double scale = 1.0; /* a pair is twice as long as a cell */
    for (int n = 0; n <= VI_LANE_ORDER; ++n, scale *= 2.0) {
        double term[VI_PARTS], middle[VI_PARTS];
        for (int part = 0; part < VI_PARTS; ++part) {
            term[part] = scale * tables->taylor[n][part][lane];
        }
        shift(&one, term, middle);
        for (int part = 0; part < VI_PARTS; ++part) {
            tables->middle[n][part][lane] = middle[part];
        }
    }
    for (int i = VI_CELLS + 2; i <= 2 * VI_PAIRS; i += 2) {
        const step before = stored(tables, lane, i - VI_CELLS), both = joined(&before, &cells);
        store(tables, lane, i, &both);
    }
    bound_pairs(tables, lane, mode, 2.0 * cell, 0);
    bound_pairs(tables, lane, mode, 2.0 * cell, 1);
}

void vi_lane_tables(vi_one_mode *tables, int lane, const vi_lane_mode *mode, double cell)
{
    step after[VI_CELLS + 1];
    after[0] = (step){.q = {[VI_OF_Q] = 1.0}, .p = {[VI_OF_P] = 1.0}, .cosine = 1.0, .sine = 0.0};
    for (int part = 0; part < VI_PARTS; ++part) {
        double term[VI_LANE_ORDER + 1], q = 0.0, slope = 0.0;
        expand(mode, cell, part, VI_LANE_ORDER, term);
        for (int n = VI_LANE_ORDER; n >= 0; --n) { /* smallest terms first */
            q += term[n];
            slope += n * term[n];
            tables->taylor[n][part][lane] = term[n];
        }
        after[1].q[part] = q;
        after[1].p[part] = slope / cell;
    }
    turn_of(mode->angular_frequency * cell, VI_LANE_ORDER, &after[1].cosine, &after[1].sine);
    for (int i = 2; i <= VI_CELLS; ++i) {
        after[i] = joined(&after[i - i / 2], &after[i / 2]); /* fewest roundings */
    }
    for (int i = 0; i <= VI_CELLS; ++i) {
        store(tables, lane, i, &after[i]);
    }
    tables->span[lane] = (double)VI_CELLS * cell;
    tables->stiffness[lane] = mode->stiffness;
    tables->load[lane] = fabs(mode->force) + fabs(mode->held);
    tables->fastest_load[lane] = mode->angular_frequency;
    tables->drag[lane] = 2.0 * mode->decay;
    tables->root_rate[lane] = 2.0 * mode->decay + sqrt(mode->stiffness);
}

/* ---- further sines ---- */

/* The step over a cell of a mode under a further sine, from that of the mode; sets the Taylor terms of the sine. */
static step sine_cell(const vi_one_mode *tables, vi_lane_sines *sines, int further, int lane, const vi_lane_mode *mode,
                      double cell)
{
    step after = stored(tables, lane, 1);
    after.q[VI_OF_ONE] = after.p[VI_OF_ONE] = 0.0;
    for (int part = 0; part < VI_SINE_PARTS; ++part) {
        double term[VI_SINE_ORDER + 1], q = 0.0, slope = 0.0;
        expand(mode, cell, VI_OF_COSINE + part, VI_SINE_ORDER, term);
        for (int n = VI_SINE_ORDER; n >= 0; --n) {
            q += term[n];
            slope += n * term[n];
            sines->taylor[n][further][part][lane] = term[n];
        }
        after.q[VI_OF_COSINE + part] = q;
        after.p[VI_OF_COSINE + part] = slope / cell;
    }
    turn_of(mode->angular_frequency * cell, VI_SINE_ORDER, &after.cosine, &after.sine);
    return after;
}

/* Set the Taylor terms of a further sine about the middles of pairs. */
static void sine_middles(const vi_one_mode *tables, vi_lane_sines *sines, int further, int lane, const step *one)
{
    double scale = 1.0;
    for (int n = 0; n <= VI_SINE_ORDER; ++n, scale *= 2.0) {
        const vi_lane_array *its = sines->taylor[n][further];
        double term[VI_PARTS] = {[VI_OF_COSINE] = scale * its[VI_OF_ITS_COSINE][lane],
                                 [VI_OF_SINE] = scale * its[VI_OF_ITS_SINE][lane]};
        if (n <= VI_LANE_ORDER) {
            term[VI_OF_Q] = scale * tables->taylor[n][VI_OF_Q][lane];
            term[VI_OF_P] = scale * tables->taylor[n][VI_OF_P][lane];
        }
        double middle[VI_PARTS];
        shift(one, term, middle);
        for (int part = 0; part < VI_SINE_PARTS; ++part) {
            sines->middle[n][further][part][lane] = middle[VI_OF_COSINE + part];
        }
    }
}

static double size_of(const vi_lane_array its[VI_SINE_PARTS], int lane)
{
    const double c = its[VI_OF_ITS_COSINE][lane], s = its[VI_OF_ITS_SINE][lane];
    return sqrt(c * c + s * s);
}

/* Add the numbers of a further sine to the bounds over pairs. */
static void bound_sine(vi_one_mode *tables, const vi_lane_sines *sines, int further, int lane, const vi_lane_mode *mode,
                       double pair, int far)
{
    double q = 0.0, p = 0.0, third, fourth;
    for (int i = 0; i <= 2 * (far ? VI_PAIRS : VI_NEAR_PAIRS); i += 2) {
        q = vi_max(q, size_of(sines->end_q[i][further], lane));
        p = vi_max(p, size_of(sines->end_p[i][further], lane));
    }
    bound_pair(mode, pair, q, p, true, &third, &fourth);
    tables->third_by[far][0][lane] += third;
    tables->fourth_by[far][0][lane] += fourth;
}

void vi_lane_sine_tables(vi_one_mode *tables, vi_lane_sines *sines, int further, int lane, const vi_lane_mode *mode,
                         double cell)
{
    step after[2 * VI_PAIRS + 1];
    after[0] = (step){.q = {[VI_OF_Q] = 1.0}, .p = {[VI_OF_P] = 1.0}, .cosine = 1.0, .sine = 0.0};
    after[1] = sine_cell(tables, sines, further, lane, mode, cell);
    for (int i = 2; i <= VI_CELLS; ++i) {
        after[i] = joined(&after[i - i / 2], &after[i / 2]);
    }
    for (int i = VI_CELLS + 2; i <= 2 * VI_PAIRS; i += 2) {
        after[i] = joined(&after[i - VI_CELLS], &after[VI_CELLS]);
    }
    for (int i = 0; i <= 2 * VI_PAIRS; i += i < VI_CELLS ? 1 : 2) {
        for (int part = 0; part < VI_SINE_PARTS; ++part) {
            sines->end_q[i][further][part][lane] = after[i].q[VI_OF_COSINE + part];
            sines->end_p[i][further][part][lane] = after[i].p[VI_OF_COSINE + part];
            sines->turned[i][further][part][lane] = part == VI_OF_ITS_COSINE ? after[i].cosine : after[i].sine;
        }
    }
    sine_middles(tables, sines, further, lane, &after[1]);
    bound_sine(tables, sines, further, lane, mode, 2.0 * cell, 0);
    bound_sine(tables, sines, further, lane, mode, 2.0 * cell, 1);
    tables->load[lane] += fabs(mode->force);
    tables->fastest_load[lane] = vi_max(tables->fastest_load[lane], mode->angular_frequency);
}
