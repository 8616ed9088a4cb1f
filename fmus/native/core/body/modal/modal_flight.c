#include "body/modal/modal_flight.h"

#include <math.h>

#include "motion/ripple.h"

void vi_flight_start(vi_flight *flight, const vi_structure_model *model, const double q[], const double p[],
                     vi_phase phase, const double held[], const double held_rate[], double length, bool local)
{
    flight->model = model;
    flight->angle = phase.angle;
    flight->angular_frequency = model->clock.angular_frequency;
    flight->length = length;
    for (int j = 0; j < model->modes; ++j) {
        vi_segment_start(&flight->segment[j], &model->mode[j], q[j], p[j], phase, held[j], held_rate[j], length, local);
        flight->length = vi_min(flight->length, flight->segment[j].length);
    }
}

void vi_flight_follow(vi_flight *flight, vi_instant now, const double q[], const double p[], const vi_origin origin[])
{
    vi_since since = {now, 0.0, 0.0};
    for (int j = 0; j < flight->model->modes; ++j) {
        vi_origin_follow(&origin[j], &flight->segment[j], &flight->model->clock, now, q[j], p[j], &since);
    }
}

void vi_flight_reach(const vi_flight *flight, vi_instant start, const double q[], const double p[], vi_origin origin[])
{
    for (int j = 0; j < flight->model->modes; ++j) {
        vi_origin_reach(&origin[j], &flight->segment[j], start, q[j], p[j]);
    }
}

void vi_point_start(vi_point *point, const vi_flight *flight, const double shape[], double sign, double clearance)
{
    *point = (vi_point){.shape = shape, .sign = sign, .scale = fabs(clearance)};
    double start = 0.0;
    for (int j = 0; j < flight->model->modes; ++j) {
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
    start += point->cosine * cos(flight->angle) + point->sine * sin(flight->angle) + point->level;
    point->offset = clearance + sign * start;
}

void vi_flight_parts(const vi_flight *flight, double u, vi_part parts[])
{
    for (int j = 0; j < flight->model->modes; ++j) {
        vi_segment_part(&flight->segment[j], u, &parts[j]);
    }
}

/* Displacement and its derivatives of the particular part; its bound on the fourth. */
static vi_part particular(const vi_point *point, const vi_flight *flight, double u)
{
    const double w = flight->angular_frequency, angle = flight->angle + w * u;
    const double c = cos(angle), s = sin(angle), square = w * w;
    const double x = point->cosine * c + point->sine * s, v = w * (point->sine * c - point->cosine * s);
    const double amplitude = sqrt(point->cosine * point->cosine + point->sine * point->sine);
    return (vi_part){x + (point->level + point->level_rate * u), v + point->level_rate, -square * x, -square * v,
                     square * square * amplitude, 0.0};
}

vi_approach vi_point_approach(const vi_point *point, const vi_flight *flight, const vi_part parts[], double u)
{
    vi_part sum = particular(point, flight, u);
    for (int j = 0; j < flight->model->modes; ++j) {
        vi_part_add(&sum, point->shape[j], &parts[j]);
    }
    return vi_part_approach(&sum, point->offset, point->sign);
}

double vi_point_step(const vi_point *point, const vi_flight *flight, const vi_part parts[], double u, double horizon)
{
    const int n = flight->model->modes;
    vi_part sum[VI_MODES + 1]; /* of the particular part and the first modes */
    double ripple[VI_MODES];
    sum[0] = particular(point, flight, u);
    for (int j = 0; j < n; ++j) {
        sum[j + 1] = sum[j];
        vi_part_add(&sum[j + 1], point->shape[j], &parts[j]);
        ripple[j] = fabs(point->shape[j]) * parts[j].reach;
    }
    return vi_rippling_step(sum, ripple, n, point->offset, point->sign, horizon);
}

bool vi_point_reach(const vi_point *point, const vi_flight *flight, double *largest)
{
    double reach = sqrt(point->cosine * point->cosine + point->sine * point->sine) + point->sign * point->level;
    for (int j = 0; j < flight->model->modes; ++j) {
        const vi_segment *segment = &flight->segment[j];
        const vi_mode *mode = segment->mode;
        if (point->shape[j] == 0.0) {
            continue;
        }
        if (segment->series || mode->natural == 0.0 || segment->level_rate != 0.0) {
            return false;
        }
        reach += fabs(point->shape[j]) * sqrt(segment->x * segment->x + segment->v * segment->v / mode->stiffness);
    }
    *largest = reach;
    return isfinite(reach);
}

void vi_flight_end(const vi_flight *flight, double u, double angle, double q[], double p[])
{
    for (int j = 0; j < flight->model->modes; ++j) {
        const vi_segment *segment = &flight->segment[j];
        if (segment->series) {
            vi_part part;
            vi_segment_part(segment, u, &part);
            q[j] = segment->origin + part.x;
            p[j] = part.v;
        } else {
            vi_segment_end(segment, u, angle, &q[j], &p[j]);
        }
    }
}
