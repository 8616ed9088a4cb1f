#include "body/modal/structure/settle.h"

#include <math.h>

#include "body/landing.h"
#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "body/modal/structure/arrival.h"
#include "body/modal/structure/contact.h"
#include "body/modal/structure/impact.h"
#include "body/modal/structure/sensitivity.h"
#include "contact/complementarity.h"

/* Force, in roundings, up to which a contact whose point others hold counts as without force. */
static const double NEGLIGIBLE_PUSH = 16.0;

/* Events at one instant after which decisions contradict each other by rounding. The joint forces of the stops then
 * decide alone. */
enum { MOST_DECISIONS = VI_MOST_EVENTS / 2 };

static bool gives_way(const vi_structure *s, int k)
{
    return s->model->stop[k] == VI_YIELDING_STOP;
}

/* Contacts that touch without speed, rigid stops first: a compliant stop presses only once it is pressed in. */
typedef struct {
    int index[VI_PORTS];
    int count, rigid;
    double gap[VI_PORTS];  /* remaining acceleration away from the stop, m/s^2 */
    double push[VI_PORTS]; /* forces of the rigid stops, N */
} resting_contacts;

static void order_resting(const vi_structure *s, const int candidate[], resting_contacts *resting)
{
    const int n = s->model->contacts;
    resting->count = resting->rigid = 0;
    for (int turn = 0; turn < 2 * n; ++turn) {
        const int k = turn % n;
        if (candidate[k] && gives_way(s, k) == (turn >= n)) {
            resting->index[resting->count++] = k;
            resting->rigid += turn < n;
        }
    }
}

/* Find the forces of the rigid stops, which only push, and the remaining acceleration of each contact. */
static void push_resting(const vi_structure *s, double g[VI_PORTS][VI_PORTS], resting_contacts *resting)
{
    double acceleration[VI_MODES], force[VI_PORTS], small[VI_PORTS][VI_PORTS], b[VI_PORTS] = {0.0};
    vi_structure_accelerate_freely(s, acceleration, force);
    for (int i = 0; i < resting->count; ++i) {
        const int k = resting->index[i];
        resting->push[i] = 0.0;
        b[i] = vi_structure_direction(s, k) * vi_structure_at(s->model, s->model->shape[k], acceleration);
        for (int j = 0; j < resting->count; ++j) {
            small[i][j] = g[k][resting->index[j]];
        }
    }
    vi_complementary(resting->rigid, small, b, resting->push);
    for (int i = 0; i < resting->count; ++i) {
        resting->gap[i] = -b[i];
        for (int j = 0; j < resting->count; ++j) {
            resting->gap[i] += small[i][j] * resting->push[j];
        }
    }
}

/* Decide about a contact that touches without speed; `push` is the acceleration that its stop would have to take. */
static void decide(const vi_structure *s, int k, double gap, double push)
{
    vi_held_view view;
    vi_structure_look_at_held(s, k, &view);
    const bool compliant = gives_way(s, k), was_held = s->state->status[k] == VI_CONTACT_HELD;
    const int32_t leaving = s->state->leaving[k];
    const double taken = compliant ? push : push * view.mobility;
    const bool tie = fabs(gap) <= view.noise && taken <= view.noise;
    const bool nothing = fabs(gap) <= view.noise && taken <= NEGLIGIBLE_PUSH * view.noise;
    const bool idle = (nothing || compliant) && vi_structure_is_kept(s, k);
    const bool neither = view.lead == 0.0 && (view.slope == 0.0 ? leaving < 2 : leaving == 0);
    const bool stays = view.lead > 0.0 || (neither && !compliant) || was_held;
    const bool undecided = vi_clock_events_here(&s->state->standstill, s->state->now) > MOST_DECISIONS && !compliant;
    const bool pushed = gap < -view.noise || taken > (was_held ? 0.0 : view.noise);
    const bool presses = undecided ? pushed : !idle && (tie ? stays : taken > view.noise);
    if (presses && compliant) {
        vi_structure_touch_down(s, k);
    } else if (presses && !was_held) {
        if (s->sensitive != NULL) {
            vi_sensitivity_rest(s, k, NULL);
        }
        vi_structure_rest(s, k, 0.0, 0.0);
    } else if (!presses && was_held) {
        vi_structure_release(s, k, 1);
    } else if (!presses) {
        s->state->leaving[k] = !(tie || idle) ? 1 : view.first == 1 ? 2 : 3;
    }
}

/* The rigid stop with the largest push among those not yet decided: contacts that it holds leave the others idle. */
static int next_rigid(const resting_contacts *resting, const int decided[])
{
    int most = -1;
    for (int i = 0; i < resting->rigid; ++i) {
        if (!decided[i] && (most < 0 || resting->push[i] > resting->push[most])) {
            most = i;
        }
    }
    return most;
}

static void settle_resting(const vi_structure *s, const int candidate[])
{
    double g[VI_PORTS][VI_PORTS];
    int decided[VI_PORTS] = {0};
    resting_contacts resting;
    vi_structure_signed(s, s->model->compliance, g);
    order_resting(s, candidate, &resting);
    push_resting(s, g, &resting);
    for (int i = next_rigid(&resting, decided); i >= 0; i = next_rigid(&resting, decided)) {
        decided[i] = 1;
        decide(s, resting.index[i], resting.gap[i], resting.push[i]);
    }
    for (int i = resting.rigid; i < resting.count; ++i) {
        decide(s, resting.index[i], resting.gap[i], -resting.gap[i]);
    }
}

void vi_structure_settle(const vi_structure *s, bool stop_here)
{
    vi_structure_state *state = s->state;
    if (state->cascade.rounds > 0) {
        vi_structure_collide_on(s);
    }
    for (int k = 0; k < s->model->contacts; ++k) {
        if (state->status[k] == VI_CONTACT_YIELDING && vi_structure_only_touches(s, k)) {
            vi_structure_separate(s, k, false);
            state->leaving[k] = 2;
        }
    }
    int candidate[VI_PORTS], hit[VI_PORTS], any_candidate = 0, first = -1;
    for (int k = 0; k < s->model->contacts && !state->pending && state->cascade.rounds == 0; ++k) {
        candidate[k] = hit[k] = 0;
        if (!vi_structure_watched(s, k)) {
            continue;
        }
        if (state->status[k] == VI_CONTACT_HELD) {
            candidate[k] = 1;
        } else if (state->status[k] == VI_CONTACT_TOUCHING && state->leaving[k] == 0) {
            const double v = vi_structure_approach(s, k), noise = VI_ROUNDING * vi_structure_velocity_size(s, k);
            hit[k] = v > noise;
            candidate[k] = fabs(v) <= noise;
            first = hit[k] && first < 0 ? k : first;
        } else if (state->status[k] == VI_CONTACT_TOUCHING && state->leaving[k] == 1) {
            candidate[k] = 1;
        }
        any_candidate |= candidate[k] && state->status[k] == VI_CONTACT_TOUCHING;
    }
    if (first >= 0) {
        if (!vi_structure_ask(s, hit, stop_here)) {
            vi_structure_resolve_hits(s, hit);
        }
        return;
    }
    if (any_candidate) {
        settle_resting(s, candidate);
    }
}
