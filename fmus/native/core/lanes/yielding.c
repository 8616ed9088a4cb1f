/* A body of one mode with stops that yield: its tables, and the motion of one lane of it. */
#include "lanes/yielding.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "lanes/lane_state.h"
#include "lanes/lane_tables.h"
#include "lanes/lane_turn.h"
#include "lanes/sampling.h"
#include "motion/majorant.h"

#define VI_WIDTH 1
#include "lanes/touch_down.h"

/* Largest stiffness (1/s^2) and damping (1/s) of a stop: squares of rates and of cells stay in range. */
static const double LARGEST = 1e60;

/* Cells of a contact above which a point is left, if they are shorter than free cells by more than this ratio. The scalar
 * engine follows a long rest on a stiff stop in closed form; lanes would go through its cells one by one. */
static const double MOST_PRESSED = 512.0, MUCH_SHORTER = 8.0;

/* ---- the motion of a phase ---- */

/* Tables of the motion while stop `pressed`, from 1, is pressed; 0: free. */
static const vi_one_mode *tables_of(const vi_lane_group *g, int pressed)
{
    return pressed > 0 ? &g->yielding.pressed[pressed - 1] : &g->one;
}

static vi_lane_state start_of_round(const vi_lane_group *g, int lane)
{
    return (vi_lane_state){g->start_q[0][lane], g->start_p[0][lane], g->start_cosine[lane], g->start_sine[lane]};
}

/* Modal displacement and velocity of a lane. */
static void modal(const vi_lane_group *g, int lane, double *q, double *p)
{
    const int pressed = (int)g->yielding.pressed_stop[lane];
    *q = g->q[0][lane];
    *p = g->p[0][lane];
    if (pressed > 0) {
        const double sign = g->sign[pressed - 1][lane];
        *q = sign * (g->limit[pressed - 1][lane] + *q);
        *p = sign * *p;
    }
}

/* ---- phases ---- */

/* Begin a phase: stop `pressed` is pressed, from 1; 0: free. */
static void begin_phase(vi_lane_group *g, int lane, int pressed)
{
    vi_yielding *yielding = &g->yielding;
    yielding->pressed_stop[lane] = pressed;
    yielding->receding[lane] = yielding->cells_pressed[lane] = g->on[lane] = 0.0;
    g->cell[lane] = yielding->cell[pressed][lane];
    g->cell_rate[lane] = yielding->cell_rate[pressed][lane];
}

static void touch(vi_lane_group *g, int lane, int c, double approach)
{
    g->q[0][lane] = 0.0;
    g->p[0][lane] = g->approach[lane] = approach;
    g->impacts[lane] += 1.0;
    begin_phase(g, lane, c + 1);
}

static void separate(vi_lane_group *g, int lane, int c)
{
    const double sign = g->sign[c][lane];
    g->yielding.depth[lane] = g->q[0][lane];
    g->approach[lane] = g->p[0][lane];
    g->q[0][lane] = sign * (g->limit[c][lane] + vi_max(0.0, g->q[0][lane]));
    g->p[0][lane] *= sign;
    begin_phase(g, lane, 0);
    g->yielding.receding[lane] = g->on[lane] = c + 1.0;
}

/* ---- the careful search ---- */

/* Is the body beyond the rest position of stop c, which it has left? */
static bool recedes_from(const vi_lane_group *g, int lane, int c)
{
    return g->yielding.receding[lane] == c + 1
           && g->sign[c][lane] * g->q[0][lane] - g->limit[c][lane] > 0.0;
}

/* The function that rises through 0 at the next event at stop c; false if there is none in this phase. */
static bool event_at(const vi_lane_group *g, int lane, int c, const vi_lane_cell *cell, vi_lane_cell *event)
{
    const int pressed = (int)g->yielding.pressed_stop[lane];
    if (pressed > 0 && pressed != c + 1) {
        return false;
    }
    const double sign = pressed > 0 ? -1.0 : g->sign[c][lane], limit = pressed > 0 ? 0.0 : g->limit[c][lane];
    const bool by_force = pressed > 0 || recedes_from(g, lane, c);
    const double lag = by_force ? g->yielding.lag[c][lane] * g->cell_rate[lane] : 0.0;
    event->order = VI_LANE_ORDER;
    for (int n = 0; n < VI_LANE_ORDER; ++n) {
        event->term[n] = sign * (cell->term[n] + lag * ((n + 1.0) * cell->term[n + 1]));
    }
    event->term[VI_LANE_ORDER] = sign * cell->term[VI_LANE_ORDER];
    event->term[0] = g->on[lane] == c + 1 ? 0.0 : event->term[0] - limit;
    return true;
}

/* Sum of the sizes of the terms of an event's function. */
static double scale_of(const vi_lane_group *g, int lane, int c, const vi_lane_cell *cell)
{
    const bool pressed = g->yielding.pressed_stop[lane] > 0.0;
    const double lag = pressed || recedes_from(g, lane, c) ? g->yielding.lag[c][lane] * g->cell_rate[lane] : 0.0;
    return (pressed ? 0.0 : fabs(g->limit[c][lane])) + fabs(cell->term[0]) + (1.0 + lag) * fabs(cell->term[1]);
}

/* Is an event certain, although rounding moves its function by 16 roundings of its scale? */
static bool is_certain(const vi_lane_cell *event, double slope, double scale)
{
    double second = 0.0;
    for (int n = 2; n <= VI_LANE_ORDER; ++n) {
        second += n * (n - 1.0) * fabs(event->term[n]);
    }
    return slope * slope > 32.0 * DBL_EPSILON * second * scale;
}

/* Act on the event at stop c; its speed of approach is set for a rigid stop. */
static vi_cell_result act(vi_lane_group *g, int lane, int c, vi_lane_meeting *met)
{
    const double approach = g->sign[c][lane] * g->p[0][lane];
    if (g->yielding.pressed_stop[lane] > 0.0) {
        g->hit[lane] = c + 1.0;
        separate(g, lane, c);
        return VI_CELL_ACTED;
    }
    if (g->yielding.receding[lane] == c + 1) {
        g->hit[lane] = 0.0;
        begin_phase(g, lane, 0);
        return approach > 0.0 ? VI_CELL_ACTED : VI_CELL_UNDECIDED; /* it presses again */
    }
    if (g->yielding.yields[c][lane] > 0.0) {
        g->hit[lane] = c + 1.0;
        touch(g, lane, c, approach);
        return VI_CELL_ACTED;
    }
    *met = (vi_lane_meeting){c, approach};
    return VI_CELL_HIT;
}

static vi_cell_result search(vi_lane_group *g, int lane, int modes, int contacts, double *share, vi_lane_meeting *met)
{
    (void)modes;
    vi_lane_state s = {g->q[0][lane], g->p[0][lane], 0.0, 0.0};
    vi_lane_turn(g->angular_frequency[lane] * g->rest[lane], &s.cosine, &s.sine);
    g->start_q[0][lane] = s.q;
    g->start_p[0][lane] = s.p;
    g->start_cosine[lane] = s.cosine;
    g->start_sine[lane] = s.sine;
    g->jumped[lane] = g->passed[lane] = 0.0;
    g->yielding.start_pressed[lane] = g->yielding.pressed_stop[lane];
    const vi_one_mode *tables = tables_of(g, (int)g->yielding.pressed_stop[lane]);
    const vi_lane_cell cell = vi_lane_cell_from(tables, lane, &s, g->cell[lane]);
    double slope;
    int hit = -1;
    for (int c = 0; c < contacts; ++c) {
        vi_lane_cell event;
        if (!event_at(g, lane, c, &cell, &event)) {
            continue;
        }
        const double scale = scale_of(g, lane, c, &cell);
        const vi_cell_result one = vi_lane_cell_search(&event, scale, share, &slope);
        if (one == VI_CELL_UNDECIDED || (one == VI_CELL_HIT && !is_certain(&event, slope, scale))) {
            return VI_CELL_UNDECIDED;
        }
        hit = one == VI_CELL_HIT ? c : hit;
    }
    const bool recedes = hit >= 0 ? recedes_from(g, lane, hit) : false;
    vi_lane_cell_at(&cell, *share, &g->q[0][lane], &slope);
    g->p[0][lane] = slope * g->cell_rate[lane];
    g->share[lane] = *share;
    if (hit < 0) {
        return VI_CELL_CLEAR;
    }
    g->yielding.receding[lane] = recedes ? hit + 1.0 : 0.0;
    return act(g, lane, hit, met);
}

static bool rebound(vi_lane_group *g, int lane, int modes, const vi_lane_meeting *met, double after)
{
    return vi_lane_one_mode.rebound(g, lane, modes, met, after);
}

/* ---- extremes ---- */

/* Largest deviation of q from a line over a cell ahead, as in the rounds. */
static double bulge_of(const vi_one_mode *tables, int lane, const vi_lane_state *s, double cell)
{
    const double k = tables->stiffness[lane], load = tables->load[lane];
    const double norm = sqrt(s->p * s->p + k * (s->q * s->q)) + load * tables->span[lane];
    return (load + tables->root_rate[lane] * norm) * (0.125 * cell * cell);
}

/* The largest sign * q of a phase over the last round, and so far (`most`). */
static double extend(const vi_one_mode *tables, const vi_lane_group *g, int lane, double sign, double length, double most)
{
    vi_lane_state start = start_of_round(g, lane), now = start;
    const int passed = (int)(g->jumped[lane] + g->passed[lane]);
    for (int i = 0; i <= passed; ++i) {
        const int cells = i % VI_CELLS + 1;
        const double end = i < passed ? 1.0 : g->share[lane];
        const vi_lane_state next = vi_lane_after_cells(tables, lane, &start, cells);
        most = vi_max(most, sign * now.q);
        if (end > 0.0 && vi_max(sign * now.q, sign * next.q) + bulge_of(tables, lane, &start, length) > most) {
            const vi_lane_cell cell = vi_lane_cell_from(tables, lane, &now, length);
            double q, slope;
            vi_lane_cell_at(&cell, end, &q, &slope);
            most = vi_max(most, vi_max(sign * q, vi_lane_cell_crest(&cell, sign, end)));
        }
        now = next;
        start = cells == VI_CELLS ? next : start;
    }
    return most;
}

/* Limit that the rigid stops on this side set to sign * q. */
static double rigid_on(const vi_lane_group *g, int lane, int contacts, double sign)
{
    double farthest = HUGE_VAL;
    for (int c = 0; c < contacts; ++c) {
        if (g->sign[c][lane] == sign && g->yielding.yields[c][lane] == 0.0) {
            farthest = vi_min(farthest, g->limit[c][lane]);
        }
    }
    return farthest;
}

static void extremes(vi_lane_group *g, int lane, int modes, int contacts)
{
    (void)modes;
    vi_lane_record *record = &g->record;
    const int pressed = (int)g->yielding.start_pressed[lane];
    const vi_one_mode *tables = tables_of(g, pressed);
    const double side = pressed > 0 ? g->sign[pressed - 1][lane] : 1.0;
    const double level = pressed > 0 ? side * g->limit[pressed - 1][lane] : 0.0;
    const double length = g->yielding.cell[pressed][lane];
    const double most = level + extend(tables, g, lane, side, length, record->most[lane] - level);
    const double least = level - extend(tables, g, lane, -side, length, level - record->least[lane]);
    record->most[lane] = vi_max(record->most[lane], vi_min(most, rigid_on(g, lane, contacts, 1.0)));
    record->least[lane] = vi_min(record->least[lane], vi_max(least, -rigid_on(g, lane, contacts, -1.0)));
}

/* ---- the state ---- */

static void observe(vi_lane_group *g, int lane, int modes, int contacts, double *displacement, double *velocity)
{
    (void)modes;
    for (int c = 0; c < contacts; ++c) {
        const bool rigid = g->yielding.pressed_stop[lane] == 0.0 && g->yielding.yields[c][lane] == 0.0;
        if (rigid && g->sign[c][lane] * g->q[0][lane] > g->limit[c][lane]) {
            g->q[0][lane] = g->sign[c][lane] * g->limit[c][lane];
        }
    }
    modal(g, lane, displacement, velocity);
}

static void state(const vi_lane_group *g, int lane, const vi_lanes_plan *plan, double q[], double p[])
{
    (void)plan;
    modal(g, lane, &q[0], &p[0]);
}

/* ---- recorded contacts ---- */

/* Change of the speed of approach that the stop has taken since the touch-down: the balance of momentum. */
static double taken(const vi_lane_group *g, int lane, int c, double duration, double sine)
{
    const vi_yielding *yielding = &g->yielding;
    const vi_one_mode *pressed = &yielding->pressed[c];
    const double spring = pressed->stiffness[lane] - g->one.stiffness[lane], w = g->angular_frequency[lane];
    const double lag = yielding->lag[c][lane], depth = yielding->depth[lane], damping = spring * lag;
    /* the force's second Taylor term over a cell, and the constant load's, are loads cell^2 / 2 */
    const double cell = yielding->cell[c + 1][lane], half = 0.5 * cell * cell;
    const double force = pressed->taylor[2][VI_OF_COSINE][lane] / half, held = pressed->taylor[2][VI_OF_ONE][lane] / half;
    const double swing = w > 0.0 ? (sine - yielding->touch_sine[lane]) / w : duration;
    const double change = g->approach[lane] - yielding->touch_approach[lane];
    const double way = (force * swing + held * duration - change - pressed->drag[lane] * depth) / pressed->stiffness[lane];
    return spring * way + damping * depth;
}

/* Largest depth + lag * rate from the touch-down on, for `duration`. */
static double peak(const vi_lane_group *g, int lane, int c, double duration)
{
    const vi_yielding *yielding = &g->yielding;
    const vi_one_mode *tables = &yielding->pressed[c];
    const double length = yielding->cell[c + 1][lane], lag = yielding->lag[c][lane] * yielding->cell_rate[c + 1][lane];
    vi_lane_state now = {0.0, yielding->touch_approach[lane], yielding->touch_cosine[lane], yielding->touch_sine[lane]};
    double left = duration * yielding->cell_rate[c + 1][lane], most = 0.0;
    for (; left > 0.0; left -= 1.0) {
        const vi_lane_cell cell = vi_lane_cell_from(tables, lane, &now, length);
        const double end = vi_min(left, 1.0);
        vi_lane_cell press = {.order = VI_LANE_ORDER};
        double value, slope;
        for (int n = 0; n < VI_LANE_ORDER; ++n) {
            press.term[n] = cell.term[n] + lag * ((n + 1.0) * cell.term[n + 1]);
        }
        press.term[VI_LANE_ORDER] = cell.term[VI_LANE_ORDER];
        vi_lane_cell_at(&press, end, &value, &slope);
        most = vi_max(vi_max(most, press.term[0]), vi_max(value, vi_lane_cell_crest(&press, 1.0, end)));
        now = vi_lane_after_cells(tables, lane, &now, 1);
    }
    return most;
}

static void write(const vi_lane_group *g, vi_lanes_points *points, int lane, const double row[VI_IMPACT_WIDTH])
{
    const int64_t point = (int64_t)g->record.point[lane];
    memcpy(points->rows + points->rows_used * VI_IMPACT_WIDTH, row, VI_IMPACT_WIDTH * sizeof row[0]);
    points->owner[points->rows_used++] = point;
    points->rows_of[point] += 1;
}

void vi_yielding_write(vi_lane_group *g, vi_lanes_points *points, int lane)
{
    vi_yielding *yielding = &g->yielding;
    const int c = (int)g->hit[lane] - 1;
    const double whole = g->periods[lane] - yielding->touch_periods[lane];
    const double duration = (whole * g->period[lane] + (g->rest[lane] - yielding->touch_rest[lane]))
                            + (whole * g->period_low[lane] + (g->rest_low[lane] - yielding->touch_rest_low[lane]));
    const double approach = yielding->touch_approach[lane], unit = g->record.unit[c][lane];
    double cosine, sine;
    vi_lane_turn(g->angular_frequency[lane] * g->rest[lane], &cosine, &sine);
    const double row[VI_IMPACT_WIDTH] = {yielding->touch_time[lane],
                                         yielding->touch_phase[lane],
                                         approach * unit,
                                         taken(g, lane, c, duration, sine) * unit * g->record.impulse[c][lane],
                                         c + 1.0,
                                         vi_max(0.0, -g->approach[lane]) / approach,
                                         duration,
                                         peak(g, lane, c, duration) * yielding->force[c][lane]};
    write(g, points, lane, row);
    yielding->open[lane] = 0.0;
}

void vi_yielding_write_open(vi_lane_group *g, vi_lanes_points *points, int lane)
{
    vi_yielding *yielding = &g->yielding;
    if (yielding->open[lane] > 0.0) {
        const int c = (int)yielding->pressed_stop[lane] - 1;
        const double row[VI_IMPACT_WIDTH] = {yielding->touch_time[lane],
                                             yielding->touch_phase[lane],
                                             yielding->touch_approach[lane] * g->record.unit[c][lane],
                                             NAN,
                                             c + 1.0,
                                             NAN,
                                             NAN,
                                             NAN};
        write(g, points, lane, row);
        yielding->open[lane] = 0.0;
    }
}

int vi_yielding_record(vi_lane_group *g, vi_lanes_points *points, int lane)
{
    const bool touches = g->hit[lane] > 0.0 && g->yielding.pressed_stop[lane] > 0.0;
    if (touches && g->record.impacts[lane] > 0.0) {
        note_touch_downs(g, lane, (mask){-1});
    } else if (g->hit[lane] > 0.0 && !touches && g->yielding.open[lane] > 0.0) {
        vi_yielding_write(g, points, lane);
    }
    return touches && g->impacts[lane] >= g->most_impacts[lane] ? VI_EVENT_IMPACT : VI_EVENT_NONE;
}

/* ---- the start ---- */

/* Set the tables of stop c; false where its parameters are invalid or out of range. */
static bool take_stop(vi_lane_group *g, int lane, int c, const vi_lanes_points *points, int64_t point)
{
    vi_yielding *yielding = &g->yielding;
    const int64_t i = c * points->count + point;
    const double mobility = points->shape[i] * points->impulse[i], lag = points->contact_damping[i] / points->contact_stiffness[i];
    const double spring = points->contact_stiffness[i] * mobility, damping = points->contact_damping[i] * mobility;
    const double sign = g->sign[c][lane], stiffness = points->stiffness[point] + spring;
    const double drag = 2.0 * points->decay[point] + damping;
    if (!(spring > 0.0) || !(stiffness < LARGEST) || !(damping >= 0.0) || !(drag < LARGEST) || !isfinite(lag)) {
        return false;
    }
    const vi_lane_mode mode = {stiffness, 0.5 * drag, sign * points->force[point],
                               sign * points->held[point] - points->stiffness[point] * g->limit[c][lane],
                               points->angular_frequency[point]};
    const double fastest = vi_max(vi_max(sqrt(stiffness), drag), mode.angular_frequency);
    const double cell = vi_lane_cell_length(vi_min(VI_CELL_REACH / fastest, VI_LONGEST_CELL * g->period[lane]));
    if (!(cell > 0.0) || !isfinite(1.0 / (cell * cell)) || !isfinite(mode.held)) {
        return false;
    }
    vi_lane_tables(&yielding->pressed[c], lane, &mode, cell);
    yielding->cell[c + 1][lane] = cell;
    yielding->cell_rate[c + 1][lane] = 1.0 / cell;
    yielding->lag[c][lane] = lag;
    yielding->yields[c][lane] = 1.0;
    yielding->force[c][lane] = spring / fabs(points->impulse[i]);
    for (int cells = 0; cells <= VI_CELLS; ++cells) {
        for (int part = 0; part < VI_PARTS; ++part) {
            const vi_one_mode *pressed = &yielding->pressed[c];
            yielding->pressed_end[c][cells][part][lane] =
                pressed->end_q[cells][part][lane] + lag * pressed->end_p[cells][part][lane];
            yielding->receding_end[c][cells][part][lane] =
                g->one.end_q[cells][part][lane] + lag * g->one.end_p[cells][part][lane];
        }
    }
    return true;
}

static bool take(vi_lane_group *g, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points, int64_t point,
                 const double q[], const double p[])
{
    vi_yielding *yielding = &g->yielding;
    if (!vi_lane_one_mode.take(g, lane, plan, points, point, q, p)
        || (plan->contacts == 2 && g->sign[0][lane] == g->sign[1][lane])) {
        return false;
    }
    yielding->cell[0][lane] = g->cell[lane];
    yielding->cell_rate[0][lane] = g->cell_rate[lane];
    yielding->pressed_stop[lane] = yielding->receding[lane] = yielding->start_pressed[lane] = 0.0;
    yielding->cells_pressed[lane] = yielding->open[lane] = 0.0;
    yielding->most_pressed[lane] = HUGE_VAL;
    for (int c = 0; c < plan->contacts; ++c) {
        yielding->yields[c][lane] = yielding->lag[c][lane] = 0.0;
        if (((plan->yielding >> c) & 1) != 0 && !take_stop(g, lane, c, points, point)) {
            return false;
        }
        if (yielding->yields[c][lane] > 0.0 && yielding->cell[c + 1][lane] * MUCH_SHORTER < yielding->cell[0][lane]) {
            yielding->most_pressed[lane] = MOST_PRESSED;
        }
    }
    return true;
}

const vi_lane_body vi_lane_yielding = {take,    search, rebound,             extremes,
                                            observe, state,  vi_lane_sample_from, vi_lane_take_samples};
