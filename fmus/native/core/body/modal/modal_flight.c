#include "body/modal/modal_flight.h"

#include <math.h>

#include "motion/mode_series.h"
#include "motion/ripple.h"

static const double THIRD = 1.0 / 3.0, SIXTH = 1.0 / 6.0;

void vi_flight_start(vi_flight *flight, const vi_structure_model *model, const double q[], const double p[],
                     vi_phase phase, const double held[], const double held_rate[], double length, bool local)
{
    flight->model = model;
    flight->phase = phase;
    flight->angular_frequency = model->clock.angular_frequency;
    flight->length = length;
    flight->series = false;
    if (local) {
        vi_segments_start_local(flight->segment, model->mode, vi_structure_modes(model), q, p, phase, held, held_rate,
                                length);
    }
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        vi_segment *segment = &flight->segment[j];
        if (!local) {
            vi_segment_start(segment, &model->mode[j], q[j], p[j], phase, held[j], held_rate[j], length, false);
        }
        flight->length = vi_min(flight->length, segment->length);
        flight->series = flight->series || segment->series;
    }
}

void vi_flight_follow(vi_flight *flight, vi_instant now, const double q[], const double p[], const vi_origin origin[])
{
    vi_since since = {now, 0.0, 0.0};
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        vi_origin_follow(&origin[j], &flight->segment[j], &flight->model->clock, now, q[j], p[j], &since);
    }
}

void vi_flight_reach(const vi_flight *flight, vi_instant start, const double q[], const double p[], vi_origin origin[])
{
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        vi_origin_reach(&origin[j], &flight->segment[j], start, q[j], p[j]);
    }
}

void vi_point_start(vi_point *point, const vi_flight *flight, const double shape[], double sign, double clearance)
{
    *point = (vi_point){.shape = shape, .sign = sign, .scale = fabs(clearance)};
    double start = 0.0;
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        const vi_segment *segment = &flight->segment[j];
        point->scale += fabs(shape[j]) * segment->scale;
        if (segment->series) {
            continue;
        }
        start += shape[j] * segment->start;
        point->cosine += shape[j] * segment->mode->steady_cos;
        point->sine += shape[j] * segment->mode->steady_sin;
        point->level += shape[j] * segment->level;
        point->level_rate += shape[j] * segment->level_rate;
    }
    start += point->cosine * flight->phase.cosine + point->sine * flight->phase.sine + point->level;
    point->steady = sqrt(point->cosine * point->cosine + point->sine * point->sine);
    point->offset = clearance + sign * start;
}

void vi_flight_at(const vi_flight *flight, double u, vi_flight_instant *instant)
{
    const double angle = flight->phase.angle + flight->angular_frequency * u;
    instant->u = u;
    instant->cosine = u == 0.0 ? flight->phase.cosine : cos(angle);
    instant->sine = u == 0.0 ? flight->phase.sine : sin(angle);
    const int modes = vi_structure_modes(flight->model);
    int j = flight->series && u > 0.0 ? vi_series_parts(flight->segment, modes, u, instant->part) : 0;
    for (; j < modes; ++j) {
        vi_segment_part(&flight->segment[j], u, &instant->part[j]);
    }
}

/* The particular part: displacement, derivatives and the bound on the fourth derivative. */
static vi_part particular(const vi_point *point, const vi_flight *flight, const vi_flight_instant *now)
{
    const double w = flight->angular_frequency, square = w * w;
    const double x = point->cosine * now->cosine + point->sine * now->sine;
    const double v = w * (point->sine * now->cosine - point->cosine * now->sine);
    return (vi_part){x + (point->level + point->level_rate * now->u), v + point->level_rate, -square * x, -square * v,
                     square * square * point->steady, 0.0};
}

vi_approach vi_point_approach(const vi_point *point, const vi_flight *flight, const vi_flight_instant *instant)
{
    vi_part sum = particular(point, flight, instant);
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        vi_part_add(&sum, point->shape[j], &instant->part[j]);
    }
    return vi_part_approach(&sum, point->offset, point->sign);
}

double vi_point_step(const vi_point *point, const vi_flight *flight, const vi_flight_instant *instant, double horizon)
{
    const int n = vi_structure_modes(flight->model);
    vi_part sum[VI_MODES + 1], so_far = particular(point, flight, instant); /* with the first modes */
    double ripple[VI_MODES];
    vi_part_keep(&sum[0], &so_far);
    for (int j = 0; j < n; ++j) {
        vi_part_add(&so_far, point->shape[j], &instant->part[j]);
        vi_part_keep(&sum[j + 1], &so_far);
        ripple[j] = fabs(point->shape[j]) * instant->part[j].reach;
    }
    return vi_rippling_step(sum, ripple, n, point->offset, point->sign, horizon);
}

bool vi_point_reach(const vi_point *point, const vi_flight *flight, double *largest)
{
    double reach = point->steady + point->sign * point->level;
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        const vi_segment *segment = &flight->segment[j];
        const vi_mode *mode = segment->mode;
        if (point->shape[j] == 0.0) {
            continue;
        }
        if (segment->series || mode->natural == 0.0 || vi_mode_grows(mode) || segment->level_rate != 0.0) {
            return false;
        }
        reach += fabs(point->shape[j]) * sqrt(segment->x * segment->x + segment->v * segment->v / mode->stiffness);
    }
    *largest = reach;
    return isfinite(reach);
}

void vi_flight_end(const vi_flight *flight, double u, double angle, double q[], double p[])
{
    const vi_phase phase = vi_phase_of(angle);
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        vi_segment_end(&flight->segment[j], u, phase, &q[j], &p[j]);
    }
}

void vi_flight_end_near(const vi_flight *flight, const vi_flight_instant *instant, double moment, double q[],
                        double p[], vi_phase *phase)
{
    const double w = flight->angular_frequency, turn = w * moment, half = 0.5 * moment, third = moment * THIRD;
    const double less = 1.0 - 0.5 * turn * turn, more = turn * (1.0 - turn * turn * SIXTH);
    const double c = instant->cosine * less - instant->sine * more, s = instant->sine * less + instant->cosine * more;
    *phase = (vi_phase){flight->phase.angle + w * (instant->u + moment), c, s};
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        const vi_segment *segment = &flight->segment[j];
        const vi_mode *mode = segment->mode;
        const vi_part *part = &instant->part[j];
        q[j] = part->x + moment * (part->v + half * (part->a + third * part->j));
        p[j] = part->v + moment * (part->a + half * part->j);
        if (segment->series) {
            q[j] += segment->origin;
            continue;
        }
        q[j] += (mode->steady_cos * c + mode->steady_sin * s)
                + (segment->level + segment->level_rate * (instant->u + moment));
        p[j] += w * (mode->steady_sin * c - mode->steady_cos * s) + segment->level_rate;
    }
}
