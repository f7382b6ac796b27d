"""Video of the loopback ANAFI: RTSP, RTP, H.264, and the telemetry of each frame."""
