#include "replay.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "plain.h"
#include "player.h"
#include "replay_variables.h"

static void defaults(void *self)
{
    replay *it = self;
    it->described = -1;
    for (int k = 0; k < VI_REPLAY_CHANNELS; ++k) {
        it->channels[k].gain = 1.0;
    }
}

static void *open_recording(const char *folder, char message[VI_MESSAGE_LENGTH])
{
    return vi_recording_open(folder, message);
}

static void close_recording(void *resources)
{
    vi_recording_close(resources);
}

static void attach(void *self, const void *resources)
{
    ((replay *)self)->recording = resources;
}

static void sized(void *self, const char *block, int count)
{
    if (strcmp(block, "channels") == 0) {
        ((replay *)self)->described = count;
    }
}

static int channel_count(const replay *it)
{
    return it->recording == NULL ? 0 : it->recording->signal_count;
}

static void update_outputs(void *self)
{
    replay *it = self;
    const double time = it->time - it->time_shift;
    vi_place places[VI_REPLAY_CHANNELS];
    for (int a = 0; a < (it->recording == NULL ? 0 : it->recording->axis_count); ++a) {
        places[a] = vi_axis_place(&it->recording->axes[a], time);
    }
    for (int k = 0; k < channel_count(it); ++k) {
        const vi_signal *signal = &it->recording->signals[k];
        const vi_playing now = vi_signal_at(signal, &it->recording->axes[signal->axis], &places[signal->axis]);
        replay_channel *channel = &it->channels[k];
        channel->value = channel->gain * now.value + channel->offset;
        channel->rate = channel->gain * now.rate;
        channel->valid = now.valid;
    }
}

static void check_parameters(const replay *it, char *message)
{
    vi_check_finite(message, "time_shift", it->time_shift);
    for (int k = 0; k < channel_count(it); ++k) {
        char name[32];
        (void)snprintf(name, sizeof name, "gain of channel %d", k + 1);
        vi_check_finite(message, name, it->channels[k].gain);
        (void)snprintf(name, sizeof name, "offset of channel %d", k + 1);
        vi_check_finite(message, name, it->channels[k].offset);
    }
}

static void check_channels(const replay *it, char *message)
{
    const int count = channel_count(it);
    if (count == 0) {
        vi_complain(message,
                    "resources/signals: expected the signal files of a recording, got none. Make an FMU of one: "
                    "vibroimpact fmu replay recording.nc -o replay.fmu");
    } else if (it->described >= 0 && it->described != count) {
        vi_complain(message, "resources/signals/signals.txt: expected the %d channels of the model description, got %d",
                    it->described, count);
    }
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    const replay *it = self;
    check_channels(it, message);
    check_parameters(it, message);
    vi_check_finite(message, "start time", start_time);
    return vi_plain_start(self, start_time, message);
}

/* The recording itself is not saved. */
static size_t used_size(const void *self)
{
    return offsetof(replay, channels) + (size_t)channel_count(self) * sizeof(replay_channel);
}

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = vi_plain_step,
    .used_size = used_size,
    .sized = sized,
    .open = open_recording,
    .attach = attach,
    .close = close_recording,
    .sized_by_resources = true,
};
