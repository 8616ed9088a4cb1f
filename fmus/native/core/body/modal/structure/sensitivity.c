#include "body/modal/structure/sensitivity.h"

#include <math.h>
#include <string.h>

#include "body/modal/forces.h"
#include "body/modal/structure/variational_flow.h"
#include "contact/complementarity.h"
#include "motion/majorant.h"

/* Change of a contact's place at an event, relative to the terms of the change, that is rounding. A larger one is another
 * instant: contacts that meet together by chance have no derivative. */
static const double SAME_PLACE = 1e-8;

/* ---- between events ---- */

VI_RARE void vi_sensitivity_begin(const vi_structure *s)
{
    vi_sensitivities *all = s->sensitive;
    vi_sensitivity_end(s);
    memcpy(all->before_q, s->state->q, sizeof all->before_q);
    memcpy(all->before_p, s->state->p, sizeof all->before_p);
}

VI_RARE void vi_sensitivity_flow(const vi_structure *s, double u)
{
    for (int i = 0; i < s->sensitive->count && u > 0.0; ++i) {
        vi_variational_flow(s, i, u);
    }
}

/* ---- events ---- */

/* Move the derivatives by their shift times the motion now. */
VI_RARE static void shift_all(const vi_structure *s, double sign)
{
    double acceleration[VI_MODES], force[VI_PORTS];
    vi_structure_accelerate(s, acceleration, force);
    for (int i = 0; i < s->sensitive->count; ++i) {
        vi_sensitivity *of = &s->sensitive->of[i];
        for (int j = 0; j < vi_structure_free_modes(s->model); ++j) {
            of->q[j] += sign * of->shift * s->state->p[j];
            of->p[j] += sign * of->shift * acceleration[j];
        }
    }
}

/* The change of contact k's way into its stop, m per unit of the parameter, and the size of its terms. */
VI_RARE static double place_of(const vi_structure *s, int i, int k, double *size)
{
    const vi_parameter *parameter = &s->sensitive->parameter[i];
    const double sign = vi_structure_direction(s, k), position = parameter->port == k ? parameter->position : 0.0;
    *size = fabs(position);
    for (int j = 0; j < vi_structure_free_modes(s->model); ++j) {
        *size += fabs(s->model->shape[k][j] * s->sensitive->of[i].q[j])
                 + fabs(s->model->shape[k][j] * s->state->p[j] * s->sensitive->of[i].shift);
    }
    return sign * (vi_structure_at_body(s->model, s->model->shape[k], s->sensitive->of[i].q) - position);
}

VI_RARE static double speed_of(const vi_structure *s, int i, int k)
{
    return vi_structure_direction(s, k) * vi_structure_at_body(s->model, s->model->shape[k], s->sensitive->of[i].p);
}

VI_RARE void vi_sensitivity_meet(const vi_structure *s, int k)
{
    const double approach = vi_structure_approach(s, k);
    double size;
    vi_sensitivity_end(s);
    for (int i = 0; i < s->sensitive->count; ++i) {
        const double place = place_of(s, i, k, &size);
        s->sensitive->of[i].largest = vi_max(s->sensitive->of[i].largest, size);
        s->sensitive->of[i].shift = place == 0.0 ? 0.0 : -place / approach;
        s->sensitive->of[i].undefined |= !isfinite(s->sensitive->of[i].shift);
    }
    s->sensitive->in_event = 1;
    shift_all(s, 1.0);
}

VI_RARE void vi_sensitivity_end(const vi_structure *s)
{
    if (!s->sensitive->in_event || s->state->cascade.rounds > 0) {
        return;
    }
    shift_all(s, -1.0);
    for (int i = 0; i < s->sensitive->count; ++i) {
        s->sensitive->of[i].shift = 0.0;
    }
    s->sensitive->in_event = 0;
}

/* A contact at its stop whose place would change has no derivative: it would hit at another instant. */
VI_RARE static void expect_place(const vi_structure *s, int i, int k)
{
    vi_sensitivity *of = &s->sensitive->of[i];
    double size;
    const double place = place_of(s, i, k, &size);
    of->undefined |= !(fabs(place) <= SAME_PLACE * vi_max(size, of->largest));
}

/* Impulses act on changed masses: row row' less of their effect. */
VI_RARE static void add_impulses(const vi_structure *s, int i, double direction[VI_PORTS][VI_MODES],
                                 const double impulse[])
{
    const vi_parameter *parameter = &s->sensitive->parameter[i];
    double push = 0.0;
    for (int k = 0; k < s->model->contacts && parameter->mass != 0.0; ++k) {
        push += vi_structure_direction(s, k) * impulse[k]
                * vi_structure_at_body(s->model, parameter->row, direction[k]);
    }
    for (int j = 0; j < vi_structure_free_modes(s->model); ++j) {
        s->sensitive->of[i].p[j] += parameter->mass * push * parameter->row[j];
    }
}

/* Give these contacts these changes of their approach, by impulses along `direction`. */
VI_RARE static void constrain(const vi_structure *s, int i, double direction[VI_PORTS][VI_MODES],
                              double mobility[VI_PORTS][VI_PORTS], const int active[], const double target[])
{
    double g[VI_PORTS][VI_PORTS], b[VI_PORTS] = {0.0}, x[VI_PORTS];
    vi_structure_signed(s, mobility, g);
    for (int k = 0; k < s->model->contacts; ++k) {
        b[k] = active[k] ? speed_of(s, i, k) - target[k] : 0.0;
    }
    vi_solve_active(s->model->contacts, g, b, active, x);
    for (int k = 0; k < s->model->contacts; ++k) {
        const double push = active[k] ? vi_structure_direction(s, k) * x[k] : 0.0;
        for (int j = 0; j < vi_structure_free_modes(s->model) && push != 0.0; ++j) {
            s->sensitive->of[i].p[j] -= direction[k][j] * push;
        }
    }
}

/* The change of the approach after an impact at this speed, -r(v) v. equations.md 4.2 */
VI_RARE static double rebound_slope(const vi_structure *s, int i, int k, double approach)
{
    const vi_parameter *parameter = &s->sensitive->parameter[i];
    const vi_contact_law *law = &s->contacts[k].law;
    vi_contact_law unit = *law;
    unit.restitution = 1.0;
    const double r = vi_contact_law_restitution(law, approach), whole = vi_contact_law_restitution(&unit, approach);
    const bool falls = law->yield_velocity > 0.0 && approach > law->yield_velocity;
    double slope = -(falls ? 0.75 * r : r) * speed_of(s, i, k);
    if (parameter->port == k) {
        slope -= approach * parameter->restitution * whole;
        slope -= falls ? approach * parameter->yield_velocity * 0.25 * r / law->yield_velocity : 0.0;
    }
    return slope;
}

VI_RARE void vi_sensitivity_impact(const vi_structure *s, const int hit[], const int in_play[], const double approach[],
                                   const double impulse[])
{
    vi_structure_model *model = s->model;
    for (int i = 0; i < s->sensitive->count; ++i) {
        double target[VI_PORTS] = {0.0};
        int active[VI_PORTS] = {0};
        for (int k = 0; k < model->contacts; ++k) {
            active[k] = in_play[k] && impulse[k] > 0.0;
            if (hit[k]) {
                expect_place(s, i, k);
                target[k] = rebound_slope(s, i, k, approach[k]);
                s->sensitive->of[i].hit[k] = speed_of(s, i, k);
            }
        }
        add_impulses(s, i, model->impulse, impulse);
        constrain(s, i, model->impulse, model->mobility, active, target);
    }
}

VI_RARE void vi_sensitivity_stop(const vi_structure *s, const int stopped[], const double impulse[])
{
    const double target[VI_PORTS] = {0.0};
    for (int i = 0; i < s->sensitive->count; ++i) {
        for (int k = 0; k < s->model->contacts; ++k) {
            if (stopped[k]) {
                expect_place(s, i, k);
            }
        }
        if (impulse != NULL) {
            add_impulses(s, i, s->model->shape, impulse);
        }
        constrain(s, i, s->model->shape, s->model->compliance, stopped, target);
    }
}

VI_RARE void vi_sensitivity_rest(const vi_structure *s, int k, const double impulse[])
{
    int stopped[VI_PORTS];
    for (int l = 0; l < s->model->contacts; ++l) {
        stopped[l] = l == k || s->state->status[l] == VI_CONTACT_HELD;
    }
    vi_sensitivity_stop(s, stopped, impulse);
}

VI_RARE void vi_sensitivity_count(const vi_structure *s, int k, bool touch_down)
{
    for (int i = 0; i < s->sensitive->count; ++i) {
        vi_sensitivity *of = &s->sensitive->of[i];
        of->last_time[k] = of->shift;
        of->last_velocity[k] = touch_down ? speed_of(s, i, k) : of->hit[k];
    }
}
