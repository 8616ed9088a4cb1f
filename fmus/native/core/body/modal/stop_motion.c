#include "body/modal/stop_motion.h"

#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "motion/majorant.h"

/* ---- the modes of the motions ---- */

static bool is_sine(const vi_stop_motion *m)
{
    return m->amplitude != 0.0;
}

static bool is_driven(const vi_stop_motion *m)
{
    return m->velocity != 0.0 || m->place != 0.0 || m->knots > 0;
}

int vi_stop_motions_count(const vi_stop_motion motion[], int contacts)
{
    int count = 0;
    for (int k = 0; k < contacts; ++k) {
        count += is_sine(&motion[k]) + is_driven(&motion[k]);
    }
    return count;
}

/* The mode of this motion, new unless another stop has the same. */
static int mode_of(vi_structure_model *model, const vi_stop_motion *motion)
{
    const int first = vi_structure_free_modes(model);
    for (int j = first; j < model->modes; ++j) {
        if (memcmp(&model->given[j - first].motion, motion, sizeof *motion) == 0) {
            return j;
        }
    }
    const int j = model->modes;
    model->given[j - first] = (vi_given_mode){.motion = *motion};
    model->modes += 1;
    model->given_modes += 1;
    for (int r = 0; r < VI_PORTS; ++r) {
        model->shape[r][j] = model->impulse[r][j] = 0.0;
    }
    for (int i = 0; i < model->modes && model->coupled; ++i) {
        model->coupling[i][j] = model->coupling[j][i] = 0.0;
    }
    model->observed[j] = 0.0;
    vi_structure_mode(model, j, motion->angular_frequency, 0.0, 0.0, model->clock.angular_frequency);
    return j;
}

void vi_stop_motions_begin(vi_structure_model *model, const vi_stop_motion motion[])
{
    model->modes = vi_structure_free_modes(model);
    model->given_modes = 0;
    for (int k = 0; k < model->contacts; ++k) {
        vi_stop_motion sine, driven;
        memset(&sine, 0, sizeof sine); /* motions are compared by their bytes */
        memset(&driven, 0, sizeof driven);
        model->stop_motion[k] = motion[k];
        if (is_sine(&motion[k])) {
            sine.angular_frequency = motion[k].angular_frequency;
            sine.phase = motion[k].phase;
            sine.shift = motion[k].shift;
            model->shape[k][mode_of(model, &sine)] = -motion[k].amplitude;
        }
        if (is_driven(&motion[k])) {
            driven.velocity = motion[k].velocity;
            driven.place = motion[k].place;
            driven.since = motion[k].since;
            driven.first = motion[k].first;
            driven.knots = motion[k].knots;
            model->shape[k][mode_of(model, &driven)] = -1.0;
        }
    }
}

/* Count a sine by the clock. */
static void count_by(vi_given_mode *given, const vi_clock *clock)
{
    const vi_stop_motion *m = &given->motion;
    if (m->angular_frequency > 0.0) {
        given->sine = vi_sine_start(clock, m->angular_frequency, m->phase + m->shift);
    }
}

void vi_stop_motions_count_by(vi_structure_model *model)
{
    const int first = vi_structure_free_modes(model);
    for (int j = first; j < vi_structure_modes(model); ++j) {
        vi_given_mode *given = &model->given[j - first];
        count_by(given, &model->clock);
        vi_mode_drive(&model->mode[j], 0.0, model->clock.angular_frequency);
    }
}

/* ---- the motions in time ---- */

/* The spline of a table about an instant. Before the first instant and from the last one on it is a straight line. */
static void look_up(const vi_structure *s, const vi_stop_motion *m, vi_twofold time, vi_piece *piece)
{
    const int first = (int)m->first, count = (int)m->knots, last = first + count - 1;
    const vi_table *all = &s->tables;
    const vi_table table = {count, all->time + first, all->value + first, all->bend + first};
    const double resolution = vi_piece_resolution(time);
    const double before = (all->time[first] - time.high) - time.low, left = (all->time[last] - time.high) - time.low;
    if (before <= resolution && left > resolution) {
        vi_table_piece(&table, time, resolution, piece);
        return;
    }
    const int end = before > resolution ? first : last;
    vi_table_piece(&table, (vi_twofold){all->time[end == first ? first : last - 1], 0.0}, 0.0, piece);
    vi_piece_shift(piece, end == first ? 0.0 : all->time[last] - all->time[last - 1]);
    *piece = (vi_piece){.degree = 1,
                        .length = end == first ? before : HUGE_VAL,
                        .coefficient = {all->value[end], piece->coefficient[1]}};
    vi_piece_shift(piece, (time.high - all->time[end]) + time.low);
}

/* The course of a mode, for the amplitude 1 of a sine. */
static vi_stop_course course_of(const vi_structure *s, const vi_given_mode *given, vi_instant now)
{
    const vi_stop_motion *m = &given->motion;
    if (m->angular_frequency > 0.0) {
        const double w = m->angular_frequency, square = w * w;
        const vi_phase phase = vi_sine_phase(&given->sine, now);
        const double velocity = -w * phase.sine;
        return (vi_stop_course){phase.cosine, velocity, -square * phase.cosine, -square * velocity};
    }
    double low;
    const double time = vi_clock_time_twofold(&s->model->clock, now, &low);
    vi_piece piece = {.degree = 0};
    if (m->knots > 0) {
        look_up(s, m, (vi_twofold){time, low}, &piece);
    }
    const double along = m->place + m->velocity * ((time - m->since) + low), *c = piece.coefficient;
    return (vi_stop_course){along + c[0], m->velocity + c[1], 2.0 * c[2], 6.0 * c[3]};
}

void vi_stop_motions_at(const vi_structure *s, vi_instant now)
{
    vi_structure_state *state = s->state;
    const int first = vi_structure_free_modes(s->model);
    for (int j = first; j < vi_structure_modes(s->model); ++j) {
        const vi_stop_course c = course_of(s, &s->model->given[j - first], now);
        state->q[j] = c.displacement;
        state->p[j] = c.velocity;
        state->held[j] = state->held_rate[j] = 0.0;
        if (s->model->given[j - first].motion.knots > 0) { /* its acceleration is a load, counted like the inputs */
            state->held_rate[j] = c.jerk;
            state->held[j] = c.acceleration - c.jerk * vi_clock_elapsed(&s->model->clock, state->held_since, now);
        }
    }
}

double vi_stop_motions_room(const vi_structure *s)
{
    const int first = vi_structure_free_modes(s->model);
    double room = HUGE_VAL, low;
    vi_piece piece;
    for (int j = first; j < vi_structure_modes(s->model); ++j) {
        const vi_stop_motion *m = &s->model->given[j - first].motion;
        if (m->knots > 0) {
            const double time = vi_clock_time_twofold(&s->model->clock, s->state->now, &low);
            look_up(s, m, (vi_twofold){time, low}, &piece);
            room = vi_min(room, piece.length);
        }
    }
    return room;
}

vi_stop_course vi_stop_course_of(const vi_structure *s, int k)
{
    vi_stop_course sum = {0.0, 0.0, 0.0, 0.0};
    const int first = vi_structure_free_modes(s->model);
    for (int j = first; j < vi_structure_modes(s->model); ++j) {
        const double share = -s->model->shape[k][j];
        if (share != 0.0) {
            const vi_stop_course c = course_of(s, &s->model->given[j - first], s->state->now);
            sum.displacement += share * c.displacement;
            sum.velocity += share * c.velocity;
            sum.acceleration += share * c.acceleration;
            sum.jerk += share * c.jerk;
        }
    }
    return sum;
}

double vi_stop_motions_work(const vi_structure *s, const double impulse[])
{
    double work = 0.0;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (impulse[k] != 0.0) {
            work -= vi_structure_direction(s, k) * impulse[k] * vi_structure_stop_velocity(s, k, s->state->p);
        }
    }
    return work;
}

/* ---- other motions ---- */

/* The instant of time 0, which the phases are for. */
static vi_instant time_zero(const vi_clock *clock)
{
    vi_instant zero = {0, 0.0, 0.0};
    (void)vi_clock_instant(clock, 0.0, 0.0, &zero);
    return zero;
}

VI_RARE double vi_stop_motion_angle(const vi_structure *s, const vi_stop_motion *motion)
{
    if (!(motion->angular_frequency > 0.0)) {
        return motion->phase + motion->shift;
    }
    const vi_sine sine = vi_sine_start(&s->model->clock, motion->angular_frequency, motion->phase + motion->shift);
    return vi_sine_phase(&sine, s->state->now).angle;
}

VI_RARE vi_stop_motion vi_stop_motion_continued(const vi_structure *s, const vi_stop_motion *was, vi_stop_motion motion)
{
    double low;
    const double time = vi_clock_time_twofold(&s->model->clock, s->state->now, &low);
    motion.shift = was->shift;
    motion.place = was->place;
    motion.since = was->since;
    if (motion.angular_frequency != was->angular_frequency && is_sine(was) && is_sine(&motion)) {
        const vi_clock *clock = &s->model->clock;
        const double angle = vi_stop_motion_angle(s, was) + motion.phase - was->phase;
        const vi_sine from = vi_sine_from(clock, motion.angular_frequency, s->state->now, angle);
        motion.shift = vi_sine_phase(&from, time_zero(clock)).angle - motion.phase;
    }
    if (motion.velocity != was->velocity) {
        motion.place += was->velocity * ((time - was->since) + low);
        motion.since = time;
    }
    return motion;
}

VI_RARE double vi_stop_motion_displacement(const vi_structure *s, const vi_stop_motion *motion)
{
    vi_given_mode sine = {.motion = *motion}, driven = {.motion = *motion};
    double sum = 0.0;
    if (is_sine(motion)) {
        count_by(&sine, &s->model->clock);
        sum += motion->amplitude * course_of(s, &sine, s->state->now).displacement;
    }
    if (is_driven(motion)) {
        driven.motion.angular_frequency = 0.0;
        sum += course_of(s, &driven, s->state->now).displacement;
    }
    return sum;
}
