#include "lanes/lane_tables.h"

#include <math.h>

/* State (q, p, cosine, sine) after some cells, as rows over (q, p, cosine, sine, 1). */
typedef struct {
    double q[VI_PARTS], p[VI_PARTS];
    double cosine, sine; /* turn of the force */
} step;

/* Taylor terms of q over the share of the cell, for one part of the state, from the equation of motion. */
static void expand(const vi_lane_mode *mode, double cell, int part, double term[VI_LANE_ORDER + 1])
{
    const double square = cell * cell, turn = mode->angular_frequency * cell, turn_square = turn * turn;
    const double drag = 2.0 * mode->decay * cell, spring = mode->stiffness * square;
    double drive[2] = {0.0, 0.0};
    drive[0] = part == VI_OF_COSINE ? mode->force * square : 0.0;
    drive[1] = part == VI_OF_SINE ? -(mode->force * square) * turn : 0.0;
    term[0] = part == VI_OF_Q ? 1.0 : 0.0;
    term[1] = part == VI_OF_P ? cell : 0.0;
    for (int n = 0; n + 2 <= VI_LANE_ORDER; ++n) {
        const double share = 1.0 / ((n + 1.0) * (n + 2.0));
        const double held = n == 0 && part == VI_OF_ONE ? mode->held * square : 0.0;
        term[n + 2] = (((drive[0] + held) - drag * (n + 1.0) * term[n + 1]) - spring * term[n]) * share;
        const double next = -drive[0] * turn_square * share;
        drive[0] = drive[1];
        drive[1] = next;
    }
}

/* Cosine and sine of the force's turn over a cell. */
static void turn_of(double angle, double *cosine, double *sine)
{
    const double square = angle * angle;
    double c = 0.0, s = 0.0;
    for (int n = VI_LANE_ORDER; n >= 2; n -= 2) {
        c = (1.0 + c) * (-square / (n * (n - 1.0)));
        s = (1.0 + s) * (-square / (n * (n + 1.0)));
    }
    *cosine = 1.0 + c;
    *sine = angle + angle * s;
}

/* The step `a`, then the step `b`. */
static step joined(const step *a, const step *b)
{
    step both;
    const double turned[2][2] = {{a->cosine, -a->sine}, {a->sine, a->cosine}};
    for (int part = 0; part < VI_PARTS; ++part) {
        both.q[part] = b->q[VI_OF_Q] * a->q[part] + b->q[VI_OF_P] * a->p[part];
        both.p[part] = b->p[VI_OF_Q] * a->q[part] + b->p[VI_OF_P] * a->p[part];
    }
    for (int i = 0; i < 2; ++i) {
        both.q[VI_OF_COSINE + i] += b->q[VI_OF_COSINE] * turned[0][i] + b->q[VI_OF_SINE] * turned[1][i];
        both.p[VI_OF_COSINE + i] += b->p[VI_OF_COSINE] * turned[0][i] + b->p[VI_OF_SINE] * turned[1][i];
    }
    both.q[VI_OF_ONE] += b->q[VI_OF_ONE];
    both.p[VI_OF_ONE] += b->p[VI_OF_ONE];
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

void vi_lane_tables(vi_one_mode *tables, int lane, const vi_lane_mode *mode, double cell)
{
    step after[VI_CELLS + 1];
    after[0] = (step){.q = {[VI_OF_Q] = 1.0}, .p = {[VI_OF_P] = 1.0}, .cosine = 1.0, .sine = 0.0};
    for (int part = 0; part < VI_PARTS; ++part) {
        double term[VI_LANE_ORDER + 1], q = 0.0, slope = 0.0;
        expand(mode, cell, part, term);
        for (int n = VI_LANE_ORDER; n >= 0; --n) { /* smallest terms first */
            q += term[n];
            slope += n * term[n];
            tables->taylor[n][part][lane] = term[n];
        }
        after[1].q[part] = q;
        after[1].p[part] = slope / cell;
    }
    turn_of(mode->angular_frequency * cell, &after[1].cosine, &after[1].sine);
    for (int i = 2; i <= VI_CELLS; ++i) {
        after[i] = joined(&after[i - i / 2], &after[i / 2]); /* fewest roundings */
    }
    for (int i = 0; i <= VI_CELLS; ++i) {
        store(tables, lane, i, &after[i]);
    }
    tables->span[lane] = (double)VI_CELLS * cell;
    tables->stiffness[lane] = mode->stiffness;
    tables->load[lane] = fabs(mode->force) + fabs(mode->held);
    tables->drag[lane] = 2.0 * mode->decay;
    tables->root_rate[lane] = 2.0 * mode->decay + sqrt(mode->stiffness);
}
