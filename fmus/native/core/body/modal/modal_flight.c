#include "body/modal/modal_flight.h"

#include <math.h>

#include "motion/mode_series.h"
#include "motion/ripple.h"

static const double THIRD = 1.0 / 3.0, SIXTH = 1.0 / 6.0;

void vi_flight_start(vi_flight *flight, const vi_structure_model *model, const double q[], const double p[],
                     const vi_drive *drive, double length, bool local)
{
    const int modes = vi_structure_modes(model);
    flight->model = model;
    flight->drive = *drive;
    flight->sines = vi_mode_sines(&model->mode[0]);
    flight->angular_frequency = model->clock.angular_frequency;
    flight->length = length;
    flight->series = false;
    if (local) {
        vi_segments_start_local(flight->segment, model->mode, modes, q, p, drive, length);
    } else {
        vi_segments_start(flight->segment, model->mode, modes, q, p, drive, length);
    }
    for (int j = 0; j < modes; ++j) {
        const vi_segment *segment = &flight->segment[j];
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

/* Add the response to the further sines and to loads of higher degree. Returns the displacement by them at the start. */
static double start_further(vi_point *point, const vi_flight *flight, const double shape[])
{
    const vi_structure_model *model = flight->model;
    const int degree = vi_flight_degree(flight);
    double start = 0.0, power = 1.0;
    for (int k = 0; k < flight->sines; ++k) {
        vi_point_sine *sine = &point->further[k];
        const double w = model->mode[0].further[k].angular_frequency;
        *sine = (vi_point_sine){.angular_frequency = w, .fourth = w * w * w * w};
        for (int j = 0; j < vi_structure_modes(model); ++j) {
            const vi_further *of_mode = &flight->segment[j].mode->further[k];
            const double weight = flight->segment[j].series ? 0.0 : shape[j];
            sine->cosine += weight * of_mode->cosine;
            sine->sine += weight * of_mode->sine;
        }
        sine->amplitude = sqrt(sine->cosine * sine->cosine + sine->sine * sine->sine);
        start += sine->cosine * flight->drive.further[k].cosine + sine->sine * flight->drive.further[k].sine;
    }
    for (int n = 2; n <= degree; ++n) {
        double sum = 0.0;
        for (int j = 0; j < vi_structure_modes(model); ++j) {
            sum += flight->segment[j].series ? 0.0 : shape[j] * flight->segment[j].level_higher[n - 2];
        }
        const double order = (double)n;
        point->higher[n - 2] = sum;
        if (n >= 4) {
            point->higher_snap += order * (order - 1.0) * (order - 2.0) * (order - 3.0) * fabs(sum) * power;
            power *= 2.0 * flight->length;
        }
    }
    return start;
}

void vi_point_start(vi_point *point, const vi_flight *flight, const double shape[], double sign, double clearance)
{
    point->shape = shape;
    point->sign = sign;
    point->scale = fabs(clearance);
    point->cosine = point->sine = point->level = point->level_rate = point->higher_snap = 0.0;
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
    start += point->cosine * flight->drive.phase.cosine + point->sine * flight->drive.phase.sine + point->level;
    if (flight->sines > 0 || vi_flight_degree(flight) > 1) {
        start += start_further(point, flight, shape);
    }
    point->steady = sqrt(point->cosine * point->cosine + point->sine * point->sine);
    point->offset = clearance + sign * start;
}

/* Find the phases of the further sines at an instant: those of harmonics by powers of the turn of the clock. */
static void turn_further(const vi_flight *flight, vi_flight_instant *now)
{
    const vi_drive *drive = &flight->drive;
    const double cosine = now->cosine * drive->phase.cosine + now->sine * drive->phase.sine;
    const double sine = now->sine * drive->phase.cosine - now->cosine * drive->phase.sine;
    vi_turns turns = {1, cosine, sine};
    for (int k = 0; k < flight->sines; ++k) {
        const int64_t harmonic = flight->model->sine[k].harmonic;
        const vi_phase *start = &drive->further[k];
        const double angle = start->angle + flight->model->sine[k].angular_frequency * now->u;
        if (harmonic == 0 || now->u == 0.0) {
            now->further[k] = now->u == 0.0 ? *start : vi_phase_of(angle);
            continue;
        }
        now->further[k] = (vi_phase){angle, start->cosine, start->sine};
        vi_turn_harmonic(&now->further[k], harmonic, cosine, sine, &turns);
    }
}

void vi_flight_at(const vi_flight *flight, double u, vi_flight_instant *instant)
{
    const double angle = flight->drive.phase.angle + flight->angular_frequency * u;
    instant->u = u;
    instant->cosine = u == 0.0 ? flight->drive.phase.cosine : cos(angle);
    instant->sine = u == 0.0 ? flight->drive.phase.sine : sin(angle);
    if (flight->sines > 0) {
        turn_further(flight, instant);
    }
    const int modes = vi_structure_modes(flight->model);
    int j = flight->series && u > 0.0 ? vi_series_parts(flight->segment, modes, u, instant->part) : 0;
    for (; j < modes; ++j) {
        vi_segment_part(&flight->segment[j], u, &instant->part[j]);
    }
}

void vi_flight_further(const vi_flight *flight, double u, vi_phase further[VI_SINES_ROOM])
{
    if (u == 0.0) {
        for (int k = 0; k < flight->sines; ++k) {
            further[k] = flight->drive.further[k];
        }
    } else {
        vi_further_after(&flight->model->mode[0], flight->drive.further, u, further);
    }
}

/* Add the response to the further sines and to loads of higher degree. */
static void add_further(vi_part *sum, const vi_point *point, const vi_flight *flight, const vi_flight_instant *now)
{
    for (int k = 0; k < flight->sines; ++k) {
        const vi_point_sine *sine = &point->further[k];
        const double w = sine->angular_frequency, square = w * w, c = now->further[k].cosine, s = now->further[k].sine;
        const double x = sine->cosine * c + sine->sine * s, v = w * (sine->sine * c - sine->cosine * s);
        sum->x += x;
        sum->v += v;
        sum->a -= square * x;
        sum->j -= square * v;
        sum->snap_bound += sine->fourth * sine->amplitude;
    }
    if (vi_flight_degree(flight) > 1) {
        double value[4] = {0.0};
        vi_add_higher(point->higher, vi_flight_degree(flight), now->u, value);
        sum->x += value[0];
        sum->v += value[1];
        sum->a += value[2];
        sum->j += value[3];
        sum->snap_bound += point->higher_snap;
    }
}

/* The particular part: displacement, derivatives and the bound on the fourth derivative. */
static vi_part particular(const vi_point *point, const vi_flight *flight, const vi_flight_instant *now)
{
    const double w = flight->angular_frequency, square = w * w;
    const double x = point->cosine * now->cosine + point->sine * now->sine;
    const double v = w * (point->sine * now->cosine - point->cosine * now->sine);
    vi_part sum = {x + (point->level + point->level_rate * now->u), v + point->level_rate, -square * x, -square * v,
                   square * square * point->steady, 0.0};
    if (flight->sines > 0 || vi_flight_degree(flight) > 1) {
        add_further(&sum, point, flight, now);
    }
    return sum;
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
    for (int i = 0; i < n; ++i) {
        /* given motions first: modes are left out from the last on */
        const int shifted = i + (vi_structure_stops_move(flight->model) ? vi_structure_free_modes(flight->model) : 0);
        const int j = shifted < n ? shifted : shifted - n;
        vi_part_add(&so_far, point->shape[j], &instant->part[j]);
        vi_part_keep(&sum[i + 1], &so_far);
        ripple[i] = fabs(point->shape[j]) * instant->part[j].reach;
    }
    return vi_rippling_step(sum, ripple, n, point->offset, point->sign, horizon);
}

bool vi_point_reach(const vi_point *point, const vi_flight *flight, double *largest)
{
    double reach = point->steady + point->sign * point->level;
    for (int k = 0; k < flight->sines; ++k) {
        reach += point->further[k].amplitude;
    }
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        const vi_segment *segment = &flight->segment[j];
        const vi_mode *mode = segment->mode;
        if (point->shape[j] == 0.0) {
            continue;
        }
        if (segment->series || mode->natural == 0.0 || vi_mode_grows(mode) || segment->level_rate != 0.0
            || vi_flight_degree(flight) > 1) {
            return false;
        }
        reach += fabs(point->shape[j]) * sqrt(segment->x * segment->x + segment->v * segment->v / mode->stiffness);
    }
    *largest = reach;
    return isfinite(reach);
}

void vi_flight_end(const vi_flight *flight, double u, double angle, const vi_phase further[], double q[], double p[])
{
    const vi_phase phase = vi_phase_of(angle);
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        vi_segment_end(&flight->segment[j], u, phase, further, &q[j], &p[j]);
    }
}

/* Turn a cosine and a sine by an angle whose fourth power is negligible. */
static void turn_slightly(double turn, double *cosine, double *sine)
{
    const double less = 1.0 - 0.5 * turn * turn, more = turn * (1.0 - turn * turn * SIXTH);
    const double c = *cosine * less - *sine * more;
    *sine = *sine * less + *cosine * more;
    *cosine = c;
}

void vi_flight_end_near(const vi_flight *flight, const vi_flight_instant *instant, double moment, double q[],
                        double p[], vi_phase *phase)
{
    const double w = flight->angular_frequency, half = 0.5 * moment, third = moment * THIRD;
    double c = instant->cosine, s = instant->sine;
    turn_slightly(w * moment, &c, &s);
    const bool is_more = flight->sines > 0 || vi_flight_degree(flight) > 1;
    vi_phase further[VI_SINES_ROOM];
    for (int k = 0; k < flight->sines; ++k) {
        further[k] = instant->further[k];
        turn_slightly(flight->model->sine[k].angular_frequency * moment, &further[k].cosine, &further[k].sine);
    }
    *phase = (vi_phase){flight->drive.phase.angle + w * (instant->u + moment), c, s};
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
        if (is_more) {
            vi_segment_add_further(segment, instant->u + moment, further, &q[j], &p[j]);
        }
    }
}
