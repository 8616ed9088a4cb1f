#include "impact_stop.h"

#include <float.h>
#include <math.h>

#include "body/law_check.h"
#include "impact_stop_variables.h"
#include "plain.h"

/* Distance from the surface, relative to displacement and position, up to which a body is on the surface: rounding. */
static const double SURFACE_ROUNDING = 4.0 * DBL_EPSILON;

static void defaults(void *self)
{
    impact_stop *stop = self;
    stop->law = vi_contact_law_rigid(1.0);
    stop->law.exponent = 1.5;
    stop->side = VI_SIDE_UPPER;
    stop->applied_restitution = 1.0;
}

/* Penetration, m. A body on the surface that does not leave it has the smallest positive penetration. */
static double penetration_of(const impact_stop *stop, double rate)
{
    const double penetration = vi_contact_direction(stop->side) * (stop->displacement - stop->position);
    const double rounding = SURFACE_ROUNDING * (fabs(stop->displacement) + fabs(stop->position));
    return rate >= 0.0 && fabs(penetration) <= rounding ? fmax(penetration, DBL_MIN) : penetration;
}

static void update_outputs(void *self)
{
    impact_stop *stop = self;
    stop->applied = (vi_contact_force){0.0, 0.0, 0.0};
    stop->applied_restitution = 1.0;
    if (vi_contact_law_yields(stop->law.law)) {
        const double rate = vi_contact_direction(stop->side) * stop->velocity;
        stop->applied = vi_contact_law_force(&stop->law, penetration_of(stop, rate), rate);
    } else {
        stop->applied_restitution = vi_contact_law_restitution(&stop->law, fabs(stop->velocity));
    }
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    const impact_stop *stop = self;
    if (!vi_contact_law_exists(stop->law.law) || !vi_contact_law_is_own(stop->law.law)) {
        vi_complain_of_law(message, "law", "", vi_contact_law_is_own, stop->law.law);
    } else {
        vi_check_law_rules(message, "", &stop->law, vi_law_of(stop->law.law)->rules);
    }
    if (stop->side != VI_SIDE_UPPER && stop->side != VI_SIDE_LOWER) {
        vi_complain(message, "side: expected 1 (upper) or 2 (lower), got %lld", (long long)stop->side);
    }
    vi_check_finite(message, "position", stop->position);
    return vi_plain_start(self, start_time, message);
}

/* ---- model exchange: no states, no events; outputs follow inputs ---- */

static bool set_time(void *self, double time)
{
    ((impact_stop *)self)->time = time;
    return isfinite(time);
}

static const vi_model_exchange exchange = {.set_time = set_time};

/* ---- partial derivatives: displacement and velocity of the body count as those of one mode ---- */

static bool column(void *self, uint32_t reference, vi_line *line)
{
    const size_t offset = vi_this_description.variables[reference].offset;
    (void)self;
    line->own[0] = 1.0;
    line->shape = line->own;
    line->count = 1;
    line->displacement = offset == offsetof(impact_stop, displacement) ? 1.0 : 0.0;
    line->velocity = offset == offsetof(impact_stop, velocity) ? 1.0 : 0.0;
    return offset == offsetof(impact_stop, displacement) || offset == offsetof(impact_stop, velocity);
}

/* Set the row of an answer: its slopes over penetration and rate. */
static bool set_row(const impact_stop *stop, double over_penetration, double over_rate, vi_line *line)
{
    line->own[0] = vi_contact_direction(stop->side);
    line->shape = line->own;
    line->count = 1;
    line->displacement = over_penetration;
    line->velocity = over_rate;
    return true;
}

/* The slopes of the slopes of a power law, K n (n - 1) d^(n - 2) (1 + damping d') and damping K n d^(n - 1). A linear law
 * has none, and nor has a law without force. */
static bool row_of_slope(const impact_stop *stop, bool of_stiffness, vi_line *line)
{
    const double rate = vi_contact_direction(stop->side) * stop->velocity, depth = penetration_of(stop, rate);
    const vi_press press = vi_law_press(vi_law_of(stop->law.law), &stop->law);
    if (press.kind != VI_PRESS_POWER || !(stop->applied.force > 0.0)) {
        return true;
    }
    const double mixed = press.damping * press.exponent * press.stiffness * pow(depth, press.exponent - 1.0);
    return of_stiffness ? set_row(stop, stop->applied.stiffness * (press.exponent - 1.0) / depth, mixed, line)
                        : set_row(stop, mixed, 0.0, line);
}

/* Restitution falls as speed^(-1/4) above the yield velocity. */
static bool row_of_restitution(const impact_stop *stop, vi_line *line)
{
    const double speed = fabs(stop->velocity);
    const bool falls = stop->law.yield_velocity > 0.0 && speed > stop->law.yield_velocity
                       && !vi_contact_law_yields(stop->law.law);
    const double slope = falls ? -0.25 * stop->applied_restitution / speed : 0.0;
    const double sign = stop->velocity < 0.0 ? -1.0 : 1.0;
    return set_row(stop, 0.0, slope * sign * vi_contact_direction(stop->side), line);
}

static bool row(void *self, uint32_t reference, vi_line *line)
{
    const impact_stop *stop = self;
    switch (vi_this_description.variables[reference].offset) {
    case offsetof(impact_stop, applied_restitution): return row_of_restitution(stop, line);
    case offsetof(impact_stop, applied.force):
        return set_row(stop, stop->applied.stiffness, stop->applied.damping, line);
    case offsetof(impact_stop, applied.stiffness): return row_of_slope(stop, true, line);
    case offsetof(impact_stop, applied.damping): return row_of_slope(stop, false, line);
    default: return false;
    }
}

static const vi_partial_derivatives partial = {.begin = update_outputs, .column = column, .row = row};

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = vi_plain_step,
    .exchange = &exchange,
    .partial = &partial,
};
