#include "door/model_exchange_search.h"

#include <math.h>
#include <string.h>

enum { OK = VI_EXCHANGE_OK };

/* Most halvings of a part in search of the first meeting; then its ends are neighbouring numbers. */
enum { MOST_HALVINGS = 100 };
/* Most divisions of a part, and most readings of one search; beyond them the ends of a part judge it. */
enum { MOST_DIVISIONS = 60, MOST_READINGS = 5000 };
/* A part is smooth whose deviation from a cubic is below BENT of the way at its ends' speeds, or below SLIGHT of its gap.
 * The first SMOOTH_DIVISIONS divisions find smooth parts. */
static const double BENT = 0.1, SLIGHT = 1e-3;
enum { SMOOTH_DIVISIONS = 8 };
/* Coefficients of a polynomial of CVODE's highest order. */
enum { COEFFICIENTS = 6 };

/* One search: of the contact point `watch`, for a part of the step at whose end it has met its surface. */
typedef struct {
    vi_exchange *e;
    const vi_exchange_watch *watch;
    double near, far;
    bool is_found;
    int readings;
} search;

static bool takes_part(const vi_exchange_watch *watch)
{
    return watch->is_armed && watch->rate >= 0 && !watch->is_pressed;
}

/* The gap by the last values that were read. */
static vi_exchange_gap gap_at(const vi_exchange *e, const vi_exchange_watch *watch, double time)
{
    const double distance = watch->factor * e->values[watch->value] + watch->offset;
    return (vi_exchange_gap){time, distance - watch->level, watch->factor * e->values[watch->rate]};
}

/* Read the watched variables within the last step of CVODE. */
static int read_at(vi_exchange *e, double time)
{
    int status = vi_exchange_move_point(e, time);
    status = status != OK ? status : vi_exchange_set_point(e, time, e->point);
    return status != OK ? status : vi_exchange_read_watched(e);
}

/* equations.md 6.18: a cubic through the ends, and the part of fifth degree that the point inside determines. */
int vi_exchange_sign_changes(vi_exchange_gap first, vi_exchange_gap inside, vi_exchange_gap last, double *bend)
{
    const double s = VI_EXCHANGE_SPLIT, size = last.time - first.time;
    const double cubic[4] = {first.gap, first.gap + size * first.rate / 3.0, last.gap - size * last.rate / 3.0,
                             last.gap};
    const double fourth[5] = {cubic[0], (cubic[0] + 3.0 * cubic[1]) / 4.0, (cubic[1] + cubic[2]) / 2.0,
                              (3.0 * cubic[2] + cubic[3]) / 4.0, cubic[3]};
    const double r = 1.0 - s, bump = s * s * r * r, slope = 2.0 * s * r * (r - s);
    const double value = r * r * (r * cubic[0] + 3.0 * s * cubic[1]) + s * s * (3.0 * r * cubic[2] + s * cubic[3]);
    const double rate =
        3.0 * (r * r * (cubic[1] - cubic[0]) + 2.0 * r * s * (cubic[2] - cubic[1]) + s * s * (cubic[3] - cubic[2]));
    const double missed = (inside.gap - value) / bump;
    const double growth = (size * inside.rate - rate - slope * missed) / bump;
    const double early = (missed - s * growth) / 10.0, late = (missed + r * growth) / 10.0;
    /* a part of the gap of higher degree may be as large as that of fifth degree */
    const double fifth[COEFFICIENTS] = {fourth[0],
                                        (fourth[0] + 4.0 * fourth[1]) / 5.0,
                                        (2.0 * fourth[1] + 3.0 * fourth[2]) / 5.0 + early - fabs(early),
                                        (3.0 * fourth[2] + 2.0 * fourth[3]) / 5.0 + late - fabs(late),
                                        (4.0 * fourth[3] + fourth[4]) / 5.0,
                                        fourth[4]};
    int changes = 0;
    *bend = fmax(fabs(early), fabs(late));
    for (int i = 1; i < COEFFICIENTS; i++) {
        changes += (fifth[i] > 0.0) != (fifth[i - 1] > 0.0);
    }
    return changes;
}

static bool is_smooth(vi_exchange_gap first, vi_exchange_gap last, double bend)
{
    const double way = fabs(last.gap - first.gap) + (last.time - first.time) * fmax(fabs(first.rate), fabs(last.rate));
    return bend <= fmax(BENT * way, SLIGHT * fmin(first.gap, last.gap));
}

/* Search a part whose first gap is positive. */
static int search_part(search *s, vi_exchange_gap first, vi_exchange_gap last, int divisions)
{
    const double middle = first.time + VI_EXCHANGE_SPLIT * (last.time - first.time);
    const bool is_divisible = divisions > 0 && s->readings > 0 && first.time < middle && middle < last.time;
    int changes = last.gap > 0.0 ? 0 : 1;
    double bend = 0.0;
    vi_exchange_gap inside = first;
    if (is_divisible) {
        const int status = read_at(s->e, middle);
        if (status != OK) {
            return status;
        }
        s->readings--;
        inside = gap_at(s->e, s->watch, middle);
        changes = vi_exchange_sign_changes(first, inside, last, &bend);
    }
    const bool may_bend = is_divisible && divisions > MOST_DIVISIONS - SMOOTH_DIVISIONS
                          && !is_smooth(first, last, bend);
    if (changes <= 1 && !may_bend) {
        s->is_found = changes == 1;
        s->near = first.time;
        s->far = last.time;
        return OK;
    }
    const int status = search_part(s, first, inside, divisions - 1);
    return status != OK || s->is_found ? status : search_part(s, inside, last, divisions - 1);
}

/* The smallest gap of all contact points at an instant. */
static int nearest(vi_exchange *e, double time, double *smallest)
{
    const int status = read_at(e, time);
    *smallest = INFINITY;
    for (int64_t k = 0; status == OK && k < e->watch_count; k++) {
        if (takes_part(&e->watches[k])) {
            *smallest = fmin(*smallest, gap_at(e, &e->watches[k], time).gap);
        }
    }
    return status;
}

/* End the step where the first contact point meets its surface, between two instants. */
static int end_at_meeting(vi_exchange *e, double near, double far)
{
    double smallest;
    for (int halving = 0; halving < MOST_HALVINGS; halving++) {
        const double middle = near + 0.5 * (far - near);
        if (!(near < middle && middle < far)) {
            break;
        }
        const int status = nearest(e, middle, &smallest);
        if (status != OK) {
            return status;
        }
        *(smallest > 0.0 ? &near : &far) = middle;
    }
    const int status = nearest(e, far, &smallest);
    if (status != OK) {
        return status;
    }
    memcpy(e->states, e->point, sizeof(double) * (size_t)e->state_count);
    e->time = far;
    e->meets = 1;
    for (int64_t k = 0; k < e->watch_count; k++) {
        const bool is_met = takes_part(&e->watches[k]) && gap_at(e, &e->watches[k], far).gap <= 0.0;
        e->roots[e->indicator_count + k] = is_met ? -1 : 0;
    }
    return OK;
}

/* Keep the motion at the end of the step, whose watched variables have been read; returns whether a contact point may
 * meet its surface. */
static bool keep_ends(vi_exchange *e)
{
    bool is_any = false;
    for (int64_t k = 0; k < e->watch_count; k++) {
        vi_exchange_watch *watch = &e->watches[k];
        if (watch->rate >= 0) {
            watch->start = watch->end;
            watch->start_rate = watch->end_rate;
            watch->end = watch->factor * e->values[watch->value] + watch->offset;
            watch->end_rate = watch->factor * e->values[watch->rate];
            is_any = is_any || takes_part(watch);
        }
    }
    return is_any;
}

/* Search the step for the first meeting of one contact point; the watched variables inside the step have been read. */
static int search_contact(search *s, double before, double inside)
{
    const vi_exchange_watch *watch = s->watch;
    const vi_exchange_gap first = {before, watch->start - watch->level, watch->start_rate};
    const vi_exchange_gap last = {s->e->time, watch->end - watch->level, watch->end_rate};
    double bend;
    const int changes = vi_exchange_sign_changes(first, gap_at(s->e, watch, inside), last, &bend);
    const bool is_located = s->e->roots[s->e->indicator_count + (watch - s->e->watches)]
                            != 0; /* at its end, by CVODE */
    if (!(first.gap > 0.0) || ((changes == 0 || (changes == 1 && is_located)) && is_smooth(first, last, bend))) {
        return OK;
    }
    return search_part(s, first, last, MOST_DIVISIONS);
}

int vi_exchange_search_step(vi_exchange *e, double before, bool has_roots, bool *event)
{
    int status = e->watch_count > 0 && has_roots ? vi_exchange_set_point(e, e->time, e->states) : OK;
    status = status == OK && e->watch_count > 0 && has_roots ? vi_exchange_read_watched(e) : status;
    if (status != OK || !keep_ends(e)) {
        return status;
    }
    const double inside = before + VI_EXCHANGE_SPLIT * (e->time - before);
    double near = e->time, far = INFINITY;
    for (int64_t k = 0; k < e->watch_count; k++) {
        search found = {.e = e, .watch = &e->watches[k], .readings = MOST_READINGS};
        if (!takes_part(found.watch)) {
            continue;
        }
        status = read_at(e, inside);
        status = status != OK ? status : search_contact(&found, before, inside);
        if (status != OK) {
            return status;
        }
        if (found.is_found) {
            near = fmin(near, found.near);
            far = fmin(far, found.far);
        }
    }
    if (far > e->time) {
        return OK;
    }
    *event = false;
    return end_at_meeting(e, near, far);
}
