"""The loopback ANAFI's video: RTSP and RTP, H.264, and the telemetry of every frame."""
