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

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = vi_plain_step,
    .exchange = &exchange,
};
