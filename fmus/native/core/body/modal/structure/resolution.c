#include "body/modal/structure/resolution.h"

#include <float.h>
#include <math.h>

#include "body/chatter.h"
#include "body/modal/forces.h"
#include "motion/majorant.h"

/* Height of a bounce, relative to the displacements, near their rounding. */
static const double LOW_HEIGHT = 8.0 * DBL_EPSILON;

/* Do the bounces of another contact meet a bounce of contact k of this duration, s? The first to land ends the flight
 * of the other, whose way to its stop is then known no better than the displacements. */
static bool is_disturbed(const vi_structure *s, int k, double duration)
{
    double acceleration[VI_MODES], force[VI_PORTS];
    bool any = false;
    for (int l = 0; l < s->model->contacts; ++l) {
        const int32_t status = s->state->status[l];
        const bool flies = status == VI_CONTACT_FREE || (status == VI_CONTACT_TOUCHING && !s->state->leaving[l]);
        if (l == k || !flies || !vi_structure_watched(s, l)) {
            continue;
        }
        const double clearance = vi_max(0.0, vi_structure_clearance(s, l)), v = vi_structure_approach(s, l);
        const double most = vi_structure_most_acceleration(s, l);
        const double height = LOW_HEIGHT * vi_structure_displacement_size(s, l);
        if (clearance > vi_max(height, duration * (v + 0.5 * duration * most))) {
            continue;
        }
        if (!any) {
            vi_structure_accelerate(s, acceleration, force);
            any = true;
        }
        const double a = vi_structure_direction(s, l) * vi_structure_at(s->model, s->model->shape[l], acceleration);
        if (vi_parabola_root(clearance, v, a) <= duration || (a > 0.0 && clearance + 0.5 * v * v / a <= height)) {
            return true;
        }
    }
    return false;
}

double vi_structure_resolution(const vi_structure *s, int k, double pressure, double speed)
{
    const bool low = vi_chatter_is_low(pressure, speed, s->model->fastest)
                     && !is_disturbed(s, k, 2.0 * speed / pressure);
    return DBL_EPSILON * (low ? fabs(s->contacts[k].position) : vi_structure_displacement_size(s, k));
}

double vi_structure_bounce_resolution(const vi_structure *s, int k, double pressure, double rebound)
{
    const double integrated = s->state->exchange.unresolved * sqrt(s->model->compliance[k][k]);
    return vi_max(integrated, vi_structure_resolution(s, k, pressure, rebound));
}
