/* The lockstep of bodies of several modes: certified cells, ever shorter up to a contact, which the careful search
 * finds. Included by one C file for each instruction set; it names VI_ROUNDS, the lockstep for all bodies. */
#include "lanes/rounds.h"
#include "lanes/rounds_yielding.h"

/* Rows of the tables for the present cell lengths of the lanes. */
typedef struct {
    vector step[VI_LANES_MODES][4], bulge[VI_LANES_CONTACTS];
    vector turn_cosine, turn_sine, cells, rate;
} level_rows;

LANES_INLINE level_rows rows_of(const vi_lane_group *g, int at, int modes, int contacts, const vector amplitude[])
{
    const vi_many_modes *many = &g->many;
    level_rows rows;
    int row[VI_WIDTH];
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        row[i] = (int)many->level[at + i];
    }
    for (int j = 0; j < modes; ++j) {
        for (int i = 0; i < 4; ++i) {
            rows.step[j][i] = gather(&many->step[0][j][i], VI_LANES_MODES * 4, at, row);
        }
    }
    for (int c = 0; c < contacts; ++c) {
        const int stride = VI_POINTS * (VI_LANES_MODES + 1);
        rows.bulge[c] = gather(&many->bulge[0][c][VI_LANES_MODES], stride, at, row);
        for (int j = 0; j < modes; ++j) {
            rows.bulge[c] += gather(&many->bulge[0][c][j], stride, at, row) * amplitude[j];
        }
    }
    rows.turn_cosine = gather(many->turn_cosine, 1, at, row);
    rows.turn_sine = gather(many->turn_sine, 1, at, row);
    rows.cells = gather(many->cells, 1, at, row);
    rows.rate = gather(many->rate, 1, at, row);
    return rows;
}

/* Displacement of a point from its stop, positive towards the stop. */
LANES_INLINE vector point_at(const vi_lane_group *g, int at, int modes, int point, const vector q[], vector cosine,
                             vector sine)
{
    const vi_many_modes *many = &g->many;
    vector y = (load(many->cosine[point] + at) * cosine + load(many->sine[point] + at) * sine)
               + load(many->offset[point] + at);
    for (int j = 0; j < modes; ++j) {
        y += load(many->shape[point][j] + at) * q[j];
    }
    return y;
}

/* Has a contact just left come away over a shortest cell? Its mean velocity since then stays negative. */
LANES_INLINE mask comes_away(const vi_lane_group *g, int at, int modes, int c, const vector p[], const vector amplitude[],
                             vector cosine, vector sine, vector y)
{
    const vi_many_modes *many = &g->many;
    vector speed = load(g->angular_frequency + at)
                   * (load(many->sine[c] + at) * cosine - load(many->cosine[c] + at) * sine);
    vector bound = load(many->leaving[c][VI_LANES_MODES] + at);
    for (int j = 0; j < modes; ++j) {
        speed += load(many->shape[c][j] + at) * p[j];
        bound += load(many->leaving[c][j] + at) * amplitude[j];
    }
    return (larger(speed * load(g->cell + at), y) + bound < 0.0) & (load(many->level + at) == load(many->last + at));
}

/* The state after each cell, and the number of cells in which no contact is met. */
typedef struct {
    vector q[VI_CELLS + 1][VI_LANES_MODES], p[VI_CELLS + 1][VI_LANES_MODES];
    vector count;
} cells_ahead;

LANES_INLINE void scan_many(const vi_lane_group *g, int at, int modes, int contacts, const level_rows *rows,
                            const vector amplitude[], vector cosine, vector sine, cells_ahead *ahead)
{
    vector before[VI_LANES_CONTACTS];
    mask clear = cosine == cosine;
    const vector on = load(g->on + at);
    const vector start_cosine = cosine, start_sine = sine;
    for (int c = 0; c < contacts; ++c) {
        before[c] = point_at(g, at, modes, c, ahead->q[0], cosine, sine);
    }
    ahead->count = all(0.0);
    for (int i = 1; i <= VI_CELLS; ++i) {
        const vector *q = ahead->q[i - 1], *p = ahead->p[i - 1];
        for (int j = 0; j < modes; ++j) {
            ahead->q[i][j] = rows->step[j][0] * q[j] + rows->step[j][1] * p[j];
            ahead->p[i][j] = rows->step[j][2] * q[j] + rows->step[j][3] * p[j];
        }
        const vector turned = cosine * rows->turn_cosine - sine * rows->turn_sine;
        sine = sine * rows->turn_cosine + cosine * rows->turn_sine;
        cosine = turned;
        for (int c = 0; c < contacts; ++c) {
            const vector y = point_at(g, at, modes, c, ahead->q[i], cosine, sine);
            mask passes = larger(before[c], y) + rows->bulge[c] < 0.0;
            if (i == 1) {
                const mask here = on == (double)(c + 1);
                const mask left = comes_away(g, at, modes, c, ahead->p[0], amplitude, start_cosine, start_sine, y);
                passes = (passes & ~here) | (left & here);
            }
            clear &= passes;
            before[c] = y;
        }
        ahead->count += only(clear, all(1.0));
    }
}

LANES_INLINE bool one_round_many(vi_lane_group *g, int at, int modes, int contacts)
{
    const vi_many_modes *many = &g->many;
    cells_ahead ahead;
    vector amplitude[VI_LANES_MODES], cosine, sine;
    turn(load(g->angular_frequency + at) * load(g->rest + at), &cosine, &sine);
    for (int j = 0; j < modes; ++j) {
        const vector q = ahead.q[0][j] = load(g->q[j] + at), p = ahead.p[0][j] = load(g->p[j] + at);
        amplitude[j] = size_of(q) + size_of(p + load(many->mix[j] + at) * q) * load(many->reach[j] + at);
    }
    const level_rows rows = rows_of(g, at, modes, contacts, amplitude);
    scan_many(g, at, modes, contacts, &rows, amplitude, cosine, sine, &ahead);
    const vector to_goal = seconds_to_goal(g, at) * rows.rate;
    const vector before_goal = whole_part(smaller(larger(to_goal, all(0.0)), all((double)VI_CELLS)));
    const vector passed = smaller(ahead.count, before_goal), level = load(many->level + at);
    const mask whole = passed == (double)VI_CELLS, shortest = level == load(many->last + at);
    int row[VI_WIDTH];
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        row[i] = (int)passed[i];
    }
    store(g->start_cosine + at, cosine);
    store(g->start_sine + at, sine);
    store(g->passed + at, passed);
    store(g->share + at, all(0.0));
    store(g->many.start_level + at, level);
    for (int j = 0; j < modes; ++j) {
        store(g->start_q[j] + at, ahead.q[0][j]);
        store(g->start_p[j] + at, ahead.p[0][j]);
        vector q, p;
#pragma GCC unroll 8
        for (int i = 0; i < VI_WIDTH; ++i) {
            q[i] = ahead.q[row[i]][j][i];
            p[i] = ahead.p[row[i]][j][i];
        }
        store(g->q[j] + at, q);
        store(g->p[j] + at, p);
    }
    store(g->on + at, only(passed == 0.0, load(g->on + at)));
    store(g->many.level + at, choose(whole, larger(level - 1.0, all(0.0)), smaller(level + 1.0, load(many->last + at))));
    move_clock(g, at, passed * rows.cells, all(0.0), passed != passed);
    store(g->record.doubtful + at, load(g->record.extremes + at));
    vector event = only(load(g->record.doubtful + at) > 0.0, all((double)VI_EVENT_FLIGHT));
    event = choose(~whole & shortest, all((double)VI_EVENT_CELL), event);
    store(g->event + at, event);
    return any(event > 0.0);
}

LANES_INLINE void run_rounds_many(vi_lane_group *g, int modes, int contacts)
{
    bool found = false;
    for (int i = 0; i < VI_MOST_ROUNDS && !found; ++i) {
        for (int at = 0; at < VI_LANES; at += VI_WIDTH) {
            found |= one_round_many(g, at, modes, contacts);
        }
    }
}

void VI_ROUNDS(vi_lane_group *g, const vi_lanes_plan *plan, vi_lanes_points *points)
{
    /* a body without a contact has tables of an idle lane there: nothing meets it */
    if (plan->modes > 1) {
        run_rounds_many(g, plan->modes, plan->contacts);
    } else if (plan->yielding && plan->contacts < 2) {
        run_phase_rounds(g, plan, points, 1);
    } else if (plan->yielding) {
        run_phase_rounds(g, plan, points, 2);
    } else if (plan->contacts < 2) {
        run_rounds(g, plan, points, 1);
    } else {
        run_rounds(g, plan, points, 2);
    }
}
